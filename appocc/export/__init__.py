"""Networks for use without torch: ONNX and OpenVINO files for one rig, checked against the network they came from."""
