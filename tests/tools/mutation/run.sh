#!/usr/bin/env bash
# Mutation run of rig/computer/redundancy, analytic and fdi in a clone of the committed tree:
# PYTHON tests/tools/mutation/run.sh MODULE... (files) prints the survivors.
# cosmic-ray must be installed in the environment of PYTHON.
set -euo pipefail
port=${PORT:-18700}
bin=$(dirname "${PYTHON:-.venv/bin/python}")
bin=$(cd "$bin" && pwd)
work=$(mktemp -d)
git clone -q . "$work/tree"
cd "$work/tree"
modules=$(printf '"%s",' "$@")
cat > config.toml <<EOF
[cosmic-ray]
module-path = [${modules%,}]
timeout = 420.0
excluded-modules = []
test-command = "bash -c 'exec 3<>/dev/tcp/127.0.0.1/$port; read -t 400 -u 3 code || code=99; exit \$code'"
[cosmic-ray.distributor]
name = "local"
# Interpreted, a kernel without its decorator is the same function.
[cosmic-ray.filters.operators-filter]
exclude-operators = ["core/RemoveDecorator"]
EOF
PYTHONPATH="$PWD" PYTHONDONTWRITEBYTECODE=1 "$bin/python" tests/tools/mutation/server.py "$port" &
server=$!
trap 'kill $server' EXIT
sleep 3
"$bin/cosmic-ray" init config.toml session.sqlite
"$bin/cr-filter-operators" session.sqlite config.toml
"$bin/cosmic-ray" baseline config.toml
"$bin/cosmic-ray" exec config.toml session.sqlite
"$bin/cr-report" session.sqlite --surviving-only --show-diff > survivors.txt || true
"$bin/cr-rate" session.sqlite || true
tail -n 5 survivors.txt
echo "survivors in $PWD/survivors.txt"
