"""Export of networks to ONNX and OpenVINO files for one rig, verified against torch."""
