# Sourced by ./launch and ./test: makes .venv from requirements.lock when it is missing or stale, and compiles the engine.
# shellcheck shell=bash

root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
venv="$root/.venv"

say() { printf '%s: %s\n' "$(basename "$0")" "$*" >&2; }

# Prints the interpreter to use: python3.11 first, because PyBullet has wheels for no later one.
find_python() {
  local candidate
  for candidate in python3.11 python3 python3.12 python3.13 python3.14; do
    if "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1; then
      command -v "$candidate"
      return
    fi
  done
  say "needs Python 3.11 or newer, found $(python3 --version 2>/dev/null || echo none): install python3.11 with its venv module."
  return 1
}

# Prints three words: the Python version, what the installed dependencies and what the installed project depend on.
fingerprints() {
  "$1" - "$root" <<'PYTHON'
import hashlib, pathlib, sys

root = pathlib.Path(sys.argv[1])
version = "{}.{}".format(*sys.version_info)


def digest(*names):
    text = b"".join((root / name).read_bytes() for name in names)
    return hashlib.sha256(f"{version} {root} ".encode() + text).hexdigest()


print(version, digest("requirements.lock"), digest("requirements.lock", "pyproject.toml"))
PYTHON
}

is_current() { # stamp file name, fingerprint
  [[ -x "$venv/bin/python" && "$(cat "$venv/$1" 2>/dev/null)" == "$2" ]] && "$venv/bin/python" -c '' 2>/dev/null
}

install_environment() { # interpreter, fingerprint of the dependencies, fingerprint of the project
  local pip=("$venv/bin/python" -m pip install --quiet --quiet --no-input --disable-pip-version-check)
  if ! is_current stamp-dependencies "$2"; then
    local start=$SECONDS
    say "installing the environment into .venv: once, one or two minutes and 3 GB ..."
    rm -rf "$venv"
    if ! "$1" -m venv "$venv"; then
      say "$1 cannot make a virtual environment: install its venv module (Debian: apt install python3-venv)."
      return 1
    fi
    if ! "${pip[@]}" --require-hashes -r "$root/requirements.lock"; then
      say "the installation failed, see above; .venv is marked unfinished and will be made anew by the next call."
      return 1
    fi
    echo "$2" >"$venv/stamp-dependencies"
    say "installed in $((SECONDS - start)) s."
  fi
  if ! is_current stamp-project "$3"; then
    rm -f "$venv/stamp-project"
    if ! "${pip[@]}" --no-deps --no-build-isolation --editable "$root"; then
      say "the project itself did not install, see above: is pyproject.toml well-formed?"
      return 1
    fi
    echo "$3" >"$venv/stamp-project"
  fi
}

# Leaves a complete .venv behind or returns non-zero with one line that says why.
ensure_environment() {
  local python version dependencies project
  python="$(find_python)" || return 1
  read -r version dependencies project < <(fingerprints "$python")
  if [[ "$version" != 3.11 ]]; then
    say "Python $version: PyBullet has no wheel for it, so the robot runs on its kinematic back-end only; install python3.11 for the physics."
  fi
  if is_current stamp-dependencies "$dependencies" && is_current stamp-project "$project"; then
    return
  fi
  ( # two calls at once: the second waits for the first, where flock exists
    if command -v flock >/dev/null; then flock 9; fi
    install_environment "$python" "$dependencies" "$project"
  ) 9>"$root/.venv.lock"
}

# Compiles the model's engine when its machine code is missing or its sources have changed; says how far it is.
ensure_engine() {
  local folder
  folder="$("$venv/bin/python" -I "$root/mobee/engine/cache.py")" || return 1
  [[ -e "$folder/ready" ]] || (cd "$root" && "$venv/bin/python" -m mobee.engine >/dev/null)
}
