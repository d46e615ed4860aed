#!/usr/bin/env bash
# Weights from nothing: sets of six towns and of two that training never sees, training, judgement, a file to ship.
# configs/release.sh CONFIG [FOLDER]: a YAML file, or one of this folder by its name. Run again, it goes on where it was ended.
set -euo pipefail
config=${1:-}
[ -f "$config" ] || config=$(dirname "$0")/$config.yaml
# Told before hours of rendering.
[ -f "$config" ] || { echo "error: expected CONFIG [FOLDER], got '${1:-}', which is no file" >&2; exit 2; }
folder=${2:-runs}
scenes=${SCENES:-"1000 1400 60 64"} # of train, varied, val, test: 5 frames each, half a second apart
run=$folder/$(basename "$config" .yaml)
read -r train varied val test <<<"$scenes"

render() { # name scenes split seed [option]
  appocc simulate "$folder/sets/$1" --scenes "$2" --split "$3" --seed "$4" --seconds 2.5 --hz 2 --no-lidar "${@:5}"
}
render train "$train" train 101
render varied "$varied" train 202 --vary
render val "$val" train 7001
render test "$test" test 9001

values=(data.train="[$folder/sets/train, $folder/sets/varied]" data.val="$folder/sets/val" data.packs="$folder/packs" ${OVERRIDES:-})
if [ -d "$run" ]; then values+=(--resume); fi
appocc train "$config" "${values[@]}" --out "$run"
appocc infer "$folder/sets/test" --weights "$run/best.safetensors" --out "$folder/sets/test/bev/predicted"
appocc eval bev "$folder/sets/test" --bev predicted --json >"$run/eval.json"
appocc weights ship "$run/best.safetensors" --figures "$run/eval.json" --out "$run/appocc.safetensors" \
  --command "SCENES='$scenes' OVERRIDES='${OVERRIDES:-}' configs/release.sh $1"
appocc weights show "$run/appocc.safetensors"
