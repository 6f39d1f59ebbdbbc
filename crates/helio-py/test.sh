#!/usr/bin/env bash
# Builds helio-py into an environment of its own and runs its tests, stubtest, mypy and ruff, and builds the manual. The last
# line is "N passed, N failed, N skipped"; a step that fails counts as one failed.
#
# HELIO_RS names the command line to compare with; without it the one of the target folder is taken.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
cd "$here"

target="${CARGO_TARGET_DIR:-$(cd ../.. && pwd)/target}"
venv="$target/python-venv"
wanted=tests/requirements.txt
export CARGO_TARGET_DIR="$target"
if [ -z "${HELIO_RS:-}" ] && [ -x "$target/release/helio-rs" ]; then
    export HELIO_RS="$target/release/helio-rs"
fi

if ! cmp --silent "$wanted" "$venv/made-from.txt"; then
    rm -rf "$venv"
    python3 -m venv "$venv"
    "$venv/bin/pip" install --quiet --disable-pip-version-check -r "$wanted"
    cp "$wanted" "$venv/made-from.txt"
fi

wheels="$target/wheels-tested"
rm -rf "$wheels"
"$venv/bin/maturin" build --release --locked --quiet --interpreter "$venv/bin/python" --out "$wheels"
"$venv/bin/pip" install --quiet --disable-pip-version-check --force-reinstall --no-deps "$wheels"/*.whl

passed=0 failed=0 skipped=0
step() {
    local name=$1
    shift
    printf '== helio-py: %s\n' "$name"
    if "$@"; then
        passed=$((passed + 1))
    else
        printf '!! %s failed\n' "$name"
        failed=$((failed + 1))
    fi
}

# The manual, with the Python reference of the wheel just built; nothing in it may ask a network.
manual() {
    local site="$target/site"
    NO_MKDOCS_2_WARNING=1 "$venv/bin/mkdocs" build --quiet --strict --config-file ../../mkdocs.yml --site-dir "$site" &&
        "$venv/bin/python" tests/offline.py "$site"
}

step "stubs" "$venv/bin/python" -m mypy.stubtest helio_py --allowlist tests/stubtest.txt
step "types" "$venv/bin/mypy" --cache-dir "$target/mypy-py"
step "lint" "$venv/bin/ruff" check --quiet --cache-dir "$target/ruff" python tests
step "format" "$venv/bin/ruff" format --quiet --check --cache-dir "$target/ruff" python tests

step "manual" manual

log="$target/python-tests.log"
printf '== helio-py: tests\n'
"$venv/bin/python" -m pytest -q -rs tests 2>&1 | tee "$log" || true
count() {
    local found
    found=$(tail -n 1 "$log" | grep -oE "[0-9]+ $1" | grep -oE '[0-9]+' || true)
    echo "${found:-0}"
}
tests=$(count passed)
passed=$((passed + tests))
failed=$((failed + $(count failed) + $(count errors?)))
skipped=$((skipped + $(count skipped)))
if [ "$tests" -eq 0 ]; then
    failed=$((failed + 1))
fi
printf '%d passed, %d failed, %d skipped\n' "$passed" "$failed" "$skipped"
[ "$failed" -eq 0 ]
