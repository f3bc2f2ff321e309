# SPDX-License-Identifier: Apache-2.0
# ./launch and ./test source this file: it makes .venv from a lock file when .venv is missing or stale, and builds the native core.
# shellcheck shell=bash

root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
venv="$root/.venv"
say() { printf '%s: %s\n' "$(basename "$0")" "$*" >&2; }

# Prints the interpreter to use: the one that made .venv, else the newest; for the tests python3.11 first, under which all of them run.
find_python() { # "run" or "dev"
  local candidate candidates=(python3.14 python3.13 python3.12 python3.11 python3)
  if [[ "$1" == dev ]]; then candidates=(python3.11 "${candidates[@]}"); fi
  if [[ "$1" == run && -s "$venv/made-with" ]]; then candidates=("$(cat "$venv/made-with")" "${candidates[@]}"); fi
  for candidate in "${candidates[@]}"; do
    if "$candidate" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 15))' >/dev/null 2>&1; then
      command -v "$candidate"
      return
    fi
  done
  say "needs Python 3.11 to 3.14, found $(python3 --version 2>/dev/null || echo none): install one of them with its venv module."
  return 1
}

# Prints three words, each a hash of the Python version and of the files that decide which packages are installed to run, which to test, and the project.
fingerprints() {
  "$1" - "$root" <<'PYTHON'
import hashlib, pathlib, sys

root = pathlib.Path(sys.argv[1])
version = "{}.{}".format(*sys.version_info)


def digest(*names):
    text = b"".join((root / name).read_bytes() for name in names)
    return hashlib.sha256(f"{version} {root} ".encode() + text).hexdigest()


print(digest("requirements.lock"), digest("requirements-dev.lock"), digest("requirements.lock", "pyproject.toml"))
PYTHON
}

is_current() { # stamp file name, fingerprint
  [[ -x "$venv/bin/python" && "$(cat "$venv/$1" 2>/dev/null)" == "$2" ]] && "$venv/bin/python" -c '' 2>/dev/null
}

pip() { "$venv/bin/python" -m pip --no-input --disable-pip-version-check "$@"; }

make_venv() { # interpreter
  rm -rf "$venv"
  if ! "$1" -m venv "$venv"; then
    say "$1 cannot make a virtual environment: install its venv module (Debian: apt install python3-venv)."
    return 1
  fi
  echo "$1" >"$venv/made-with"
}

# No byte code is compiled here: most modules are never imported, and Python compiles the others at their first import.
install_packages() { # lock file, its size in words
  local log="$venv/pip.log" code=0 counter="" locked
  locked="$(grep -c '^[a-z].*==' "$1")"
  say "1 of 3: $locked packages into .venv, $2 ..."
  : >"$log"
  if [[ -t 2 ]]; then count_packages "$log" "$locked" & counter=$!; fi
  pip install --progress-bar off --no-compile --require-hashes -r "$1" >"$log" 2>&1 || code=$?
  if [[ -n "$counter" ]]; then
    kill "$counter" 2>/dev/null || true
    wait "$counter" 2>/dev/null || true
    printf '\r\033[K' >&2
  fi
  ((code == 0)) || grep -v '^WARNING' "$log" | tail -n 12 >&2
  return "$code"
}

count_packages() { # pip's log, number of packages to install
  local before all
  before="$(installed_packages)"
  while kill -0 $$ 2>/dev/null; do # Ctrl-C does not reach this process
    all="$(sed -n 's/^Installing collected packages: //p' "$1" | wc -w)"
    if ((all > 0)); then
      printf '\r  unpacking: %d of %d   ' $(($(installed_packages) - before)) "$all" >&2
    else
      printf '\r  downloading: %d of %d   ' "$(grep -c '^Collecting' "$1")" "$2" >&2
    fi
    sleep 0.3
  done
}

installed_packages() { find "$venv" -maxdepth 5 -name '*.dist-info' | wc -l; }

core_is_current() { "$venv/bin/python" "$root/core/build.py" --check "${core[@]}"; }

# Builds the core with the system's compiler; where there is none, with one that is downloaded and removed afterwards.
build_core() { # options of core/build.py
  local code=0 folder="$venv/compiler"
  "$venv/bin/python" "$root/core/build.py" "$@" >/dev/null 2>"$venv/core.log" || code=$?
  if ((code == 3)); then
    say "2 of 3: fetching a compiler for the native core, as here is none: 100 MB to download, 400 MB on disk, removed afterwards ..."
    rm -rf "$folder"
    pip install --quiet --quiet --no-compile --require-hashes --target "$folder" -r "$root/core/compiler.lock" || return 1
    code=0
    PYTHONPATH="$folder" "$venv/bin/python" "$root/core/build.py" "$@" >/dev/null 2>"$venv/core.log" || code=$?
    rm -rf "$folder"
  fi
  ((code == 0)) || cat "$venv/core.log" >&2
  return "$code"
}

# Installs what ensure_environment found to be missing; uses the variables of that function.
install_environment() {
  local start=$SECONDS
  if ! is_current "stamp-$kind" "$packages"; then
    is_current stamp-run "$run" || make_venv "$python" || return 1
    rm -f "$venv/stamp-run" "$venv/stamp-dev"
    # Packages that scripts/trim.py has cut down are installed whole again for the tests.
    if [[ -s "$venv/trimmed" ]]; then xargs "$venv/bin/python" -m pip uninstall --quiet --quiet --yes <"$venv/trimmed"; fi
    if ! install_packages "$root/$lock" "$size"; then
      say "the installation failed, see above; .venv is marked unfinished and will be made anew by the next call."
      return 1
    fi
    if [[ "$kind" == run ]]; then "$venv/bin/python" "$root/scripts/trim.py" >"$venv/trimmed"; else rm -f "$venv/trimmed"; fi
    echo "$run" >"$venv/stamp-run"
    echo "$packages" >"$venv/stamp-$kind"
  fi
  if ! core_is_current; then
    say "2 of 3: building the native core, some seconds ..."
    build_core "${core[@]}" || return 1
  fi
  if ! is_current stamp-project "$project"; then
    say "3 of 3: the project itself ..."
    rm -f "$venv/stamp-project"
    if ! pip install --quiet --quiet --no-deps --no-build-isolation --editable "$root"; then
      say "the project itself did not install, see above: is pyproject.toml well-formed?"
      return 1
    fi
    echo "$project" >"$venv/stamp-project"
  fi
  say "installed in $((SECONDS - start)) s."
}

# Makes .venv complete, with the argument "dev" also for ./test; returns non-zero, after one line with the reason, if that fails.
ensure_environment() {
  local kind="${1:-run}" python run dev project packages lock size core=()
  python="$(find_python "$kind")" || return 1
  read -r run dev project < <(fingerprints "$python")
  # Sizes are those on Linux with Python 3.11.  Warnings of the compiler are errors for the tests only: a user's compiler may be another.
  if [[ "$kind" == dev ]]; then
    packages="$dev" lock=requirements-dev.lock core=(--strict) size="1 GB to download and 3 GB on disk, one to three minutes"
  else
    packages="$run" lock=requirements.lock core=(--here --no-strict) size="400 MB to download and 1 GB on disk, half a minute to one"
  fi
  if is_current "stamp-$kind" "$packages" && is_current stamp-project "$project" && core_is_current; then
    return
  fi
  ( # two calls at once: the second waits for the first, where flock exists
    if command -v flock >/dev/null; then flock 9; fi
    install_environment
  ) 9>"$root/.venv.lock"
}
