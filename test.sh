#!/usr/bin/env bash
# Everything a change must pass, in one command. The first run builds all dependencies.
#
# Tests that read recorded data find it through HELIO_DATA; without it they are skipped, and the
# last line says how many: "N passed, N failed, N skipped". A step that fails counts as one failed.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"

out="${CARGO_TARGET_DIR:-target}"
mkdir -p "$out"
failed_steps=()

step() {
    local name=$1
    shift
    printf '== %s\n' "$name"
    if ! "$@"; then
        printf '!! %s failed\n' "$name"
        failed_steps+=("$name")
    fi
}

docs() {
    RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --release --quiet
}

# Ruff and mypy in an environment of their own, made anew when the list of them changes.
python_lint() {
    local venv="$out/lint-venv" wanted=tests/requirements-lint.txt
    if ! cmp --silent "$wanted" "$venv/made-from.txt"; then
        rm -rf "$venv"
        python3 -m venv "$venv" || return
        "$venv/bin/pip" install --quiet --disable-pip-version-check -r "$wanted" || return
        cp "$wanted" "$venv/made-from.txt"
    fi
    local files
    mapfile -t files < <(find benches crates examples tests -name '*.py' -not -path '*/.*/*' -not -path 'crates/helio-py/*' | sort)
    "$venv/bin/ruff" check --quiet --config tests/ruff.toml --cache-dir "$out/ruff" "${files[@]}" &&
        "$venv/bin/mypy" --config-file tests/mypy.ini --cache-dir "$out/mypy" "${files[@]}"
}

# All tests and every example of the documentation. Passing tests are asked to show their output,
# because that is where a skipped one says so; the log keeps it, the screen shows the outline.
log="$out/test.log"
rust_tests() {
    local status=0
    cargo test --workspace --release --no-fail-fast -- --show-output 2>&1 |
        tee "$log" |
        { grep --line-buffered -E '^( +(Running|Doc-tests|Finished) |test result:|test .*FAILED$|error)' || true; } ||
        status=$?
    if [ $status -ne 0 ] && grep -q '^failures:' "$log"; then
        # What the failing tests said.
        awk '/^failures:/ { on = 1 } /^test result:/ { on = 0 } on' "$log"
    elif [ $status -ne 0 ]; then
        tail -n 40 "$log"
    fi
    return $status
}

step "format" cargo fmt --all --check
step "lint" cargo clippy --workspace --all-targets --release --quiet -- -D warnings
step "documentation" docs
step "helio-core without std" cargo build -p helio-core --no-default-features --release --quiet
if command -v python3 >/dev/null; then
    step "Python lint" python_lint
else
    echo "== Python lint: no python3 here, left out"
fi
: >"$log"
step "tests" rust_tests

# helio-py is built by maturin and tested from Python, against the command line of this build; its last line counts.
python_tests() {
    cargo build --release --quiet -p helio-cli || return
    HELIO_RS="$(realpath "$out")/release/helio-rs" crates/helio-py/test.sh | tee "$out/helio-py.log"
}
: >"$out/helio-py.log"
if command -v python3 >/dev/null; then
    step "Python package" python_tests
else
    echo "== Python package: no python3 here, left out"
fi

# Totals over all test programs. A skipped test is one that returned early because HELIO_DATA is
# not set; cargo counts it as passed, this line does not.
read -r passed failed skipped < <(awk '
    /^test result:/ { passed += $4; failed += $6; ignored += $8; program++ }
    /^---- .* stdout ----$/ { test = program " " $2 }
    /^skipped: HELIO_DATA is not set/ && !(test in seen) { seen[test] = 1; skipped++ }
    END { print passed - skipped, failed + 0, skipped + ignored }
' "$log")
if read -r py_passed py_failed py_skipped < <(tail -n 1 "$out/helio-py.log" | grep -oE '[0-9]+' | xargs) &&
    [ -n "${py_skipped:-}" ]; then
    passed=$((passed + py_passed)) failed=$((failed + py_failed)) skipped=$((skipped + py_skipped))
fi
for name in ${failed_steps[@]+"${failed_steps[@]}"}; do
    printf 'failed: %s\n' "$name"
    # Tests that failed are counted already; a build that broke is not.
    if [ "$name" != "tests" ] || [ "$failed" -eq 0 ]; then
        failed=$((failed + 1))
    fi
done
printf '%d passed, %d failed, %d skipped\n' "$passed" "$failed" "$skipped"
[ "$failed" -eq 0 ]
