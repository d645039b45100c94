# Shared by run, test and check: make .venv from a hashed lock once, again only when an input changed.
# Sourced with: setup_venv LOCK   (LOCK is run or test)

root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
venv="${OUTCROP_VENV:-$root/.venv}"

find_python() {
    local candidate
    for candidate in "${PYTHON:-}" python3 python3.11 python3.12 python3.13; do
        [ -n "$candidate" ] && command -v "$candidate" >/dev/null 2>&1 || continue
        if "$candidate" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1; then
            command -v "$candidate"
            return 0
        fi
    done
    echo "outcrop needs Python 3.11 or newer with venv (Debian: apt-get install python3-venv); set PYTHON to its path" >&2
    return 1
}

setup_venv() {
    local lock="$root/requirements/$1.lock" stamp wanted python
    stamp="$venv/.outcrop-$1"
    wanted="$(stamp_for "$1")"
    if [ "$1" = run ] && [ -f "$venv/.outcrop-test" ] && [ "$(cat "$venv/.outcrop-test")" = "$(stamp_for test)" ]; then
        return 0 # the test set-up holds all that running needs
    fi
    if [ -f "$stamp" ] && [ "$(cat "$stamp")" = "$wanted" ]; then
        return 0
    fi
    if [ ! -x "$venv/bin/python" ]; then
        python="$(find_python)" || return 1
        echo "Making the virtual environment $venv"
        "$python" -m venv "$venv" || return 1
    fi
    echo "Installing the packages of requirements/$1.lock (a minute or two the first time)"
    if command -v uv >/dev/null 2>&1; then
        UV_COMPILE_BYTECODE=1 uv pip install --quiet --python "$venv/bin/python" --require-hashes -r "$lock" || return 1
    else
        PIP_DISABLE_PIP_VERSION_CHECK=1 "$venv/bin/python" -m pip install --quiet --require-hashes -r "$lock" || return 1
    fi
    echo "Installing outcrop itself; its build makes the browser UI"
    PIP_DISABLE_PIP_VERSION_CHECK=1 "$venv/bin/python" -m pip install --quiet --no-deps --no-build-isolation --editable "$root" || return 1
    echo "$wanted" >"$stamp"
}

stamp_for() {
    echo "$(cat "$root/requirements/$1.lock" "$root/pyproject.toml" "$root/scripts/build_web.py" | sha256sum | cut -d' ' -f1) $root"
}

build_ui() {
    "$venv/bin/python" "$root/scripts/build_web.py"
}
