#!/usr/bin/env bash
# From nothing to a first picture, timed: an environment of its own, helio-py with matplotlib, first_plot.py.
#
#   newcomer.sh [WHEEL]     from a wheel (or what pip finds under that name); without one from the sources beside it
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
from="${1:-$here/../crates/helio-py}"
from=$(realpath "$from")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

timed() {
    local name=$1 begun=$EPOCHREALTIME
    shift
    "$@"
    awk -v name="$name" -v begun="$begun" -v ended="$EPOCHREALTIME" \
        'BEGIN { printf "%-20s %7.1f s\n", name, ended - begun }'
}

begun=$EPOCHREALTIME
timed "environment" python3 -m venv "$folder/venv"
timed "pip install" "$folder/venv/bin/pip" install --quiet --disable-pip-version-check "${from}[plot]"
start=$PWD
cd "$folder"
timed "first picture" "$folder/venv/bin/python" "$here/first_plot.py"
timed "once more" "$folder/venv/bin/python" "$here/first_plot.py"
cp first_plot.png "$start/"
awk -v begun="$begun" -v ended="$EPOCHREALTIME" 'BEGIN { printf "%-20s %7.1f s\n", "in all", ended - begun }'
