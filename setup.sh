#!/usr/bin/env bash
# Sets up what the project needs on Debian 12 or newer: Debian's packages, then .venv with the project in it.
# Run by `make setup`. Running it again is safe and quick: what is already there is left alone.
set -euo pipefail
cd -P "$(dirname "${BASH_SOURCE[0]}")"

debian_packages=(
    python3-dolfinx   # finite elements, with the PETSc, MPI and numpy that they were built against
    libopenblas0-serial # dense linear algebra: factors in a fifth of the time of the reference BLAS that dolfinx brings
    python3-gmsh      # meshes
    python3-h5py      # HDF5 files; never PyPI's, see pin_versions
    python3-venv      # .venv, and the pip inside it
    python3-dev       # Python.h, for the forms that dolfinx compiles
    gcc               # the compiler of these forms
    libc6-dev         # the C library's headers, which gcc only recommends
    openmpi-bin       # mpirun of the same MPI as dolfinx's
    libgl1            # OpenGL, which VTK (pictures) loads at run time
    libegl1           # OpenGL without a display
    libgl1-mesa-dri   # OpenGL without a graphics card
)
python=/usr/bin/python3 # the interpreter that Debian's dolfinx is built for, whatever else is on the PATH
stamp=.venv/.setup
sudo_options=()
[ -t 0 ] || sudo_options=(--non-interactive) # only at a terminal is there someone to type a password

say() { echo "==> $*"; }
die() { echo "setup: $*" >&2; exit 1; }

missing_packages() {
    comm -23 <(printf '%s\n' "${debian_packages[@]}" | sort) \
        <(dpkg-query --show --showformat='${Package} ${db:Status-Status}\n' "${debian_packages[@]}" 2>/dev/null |
            sed -n 's/ installed$//p' | sort --unique)
}

# Whether packages can be installed: as root or through sudo.
may_install() {
    command -v apt-get >/dev/null || return 1
    [ "$(id -u)" -eq 0 ] && return
    command -v sudo >/dev/null && sudo "${sudo_options[@]}" --validate 2>/dev/null
}

apt_get() {
    local command=(env DEBIAN_FRONTEND=noninteractive apt-get -qq -o DPkg::Lock::Timeout=300 "$@")
    if [ "$(id -u)" -eq 0 ]; then "${command[@]}"; else sudo "${sudo_options[@]}" "${command[@]}"; fi
}

install_debian_packages() {
    local packages
    mapfile -t packages < <(missing_packages)
    [ ${#packages[@]} -gt 0 ] || return 0
    local by_hand="as root, run: apt-get install --no-install-recommends ${packages[*]}"
    may_install || die "Debian packages are missing and neither root's rights nor sudo are at hand; $by_hand"
    say "Installing Debian packages, which takes a few minutes: ${packages[*]}"
    apt_get update || say "apt-get update failed; going on with the package lists that are there"
    apt_get --yes --no-install-recommends install "${packages[@]}" </dev/null >/dev/null || die "apt-get failed; $by_hand"
}

# Keeps pip, now and whenever it is used in .venv, from replacing what Debian's dolfinx was built against or brings along.
# h5py above all: PyPI's wheel carries an HDF5 of its own, and beside dolfinx's (two in one process) it crashes.
pin_versions() {
    "$python" -I - <<'END'
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

pins = ["h5py<0  # Debian's carries no name that pip knows, so pip would add PyPI's"]
for name in ("numpy", "scipy", "mpi4py", "petsc4py", "slepc4py"):
    try:
        pins.append(f"{name}=={version(name)}")
    except PackageNotFoundError:
        pass
environment = Path(".venv").resolve()
constraints = environment / "constraints.txt"
constraints.write_text("\n".join(pins) + "\n")
(environment / "pip.conf").write_text(f"[install]\nconstraint = {constraints.as_uri()}\n")
END
}

# Fails for a .venv that is absent, moved, of another interpreter, or without Debian's packages.
environment_is_usable() {
    local version
    version=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
    [[ "$(.venv/bin/pip --version 2>/dev/null)" == *" from $PWD/.venv/"*"(python $version)" ]] &&
        grep -qx 'home = /usr/bin' .venv/pyvenv.cfg &&
        grep -qx 'include-system-site-packages = true' .venv/pyvenv.cfg
}

install_project() {
    if ! environment_is_usable; then
        say "Making .venv"
        "$python" -m venv --clear --system-site-packages .venv
    fi
    pin_versions
    say "Installing the project and its Python packages into .venv (about 600 MB the first time)"
    .venv/bin/python -m pip install --quiet --disable-pip-version-check \
        --constraint .venv/constraints.txt --editable '.[test]'
}

# Also finds copies that lie in the user's own site-packages, which a .venv that sees the system's sees too.
check_modules() {
    .venv/bin/python - <<'END'
import importlib, sys

for name in ("numpy", "mpi4py", "petsc4py", "dolfinx", "h5py", "gmsh"):
    path = importlib.import_module(name).__file__
    if not path.startswith("/usr/lib/"):
        sys.exit(f"setup: {name} must be Debian's, but Python finds {path}; remove that copy with pip uninstall {name}")
END
}

# What the stamp must say for .venv to be up to date.
wanted_state() {
    echo "$PWD" "$("$python" --version)"
    sha256sum pyproject.toml setup.sh
}

install_debian_packages
if [ "$(cat $stamp 2>/dev/null)" = "$(wanted_state)" ]; then
    say "Set up already"
else
    install_project
    check_modules
    wanted_state >$stamp
    say "Set up; make lists what can be done"
fi
