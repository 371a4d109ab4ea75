#!/bin/bash
# Installs the Debian packages that are missing; asks nothing; quick when nothing is missing.
# usage: tools/setup.sh [--run] [--mpi] [--slurm] [PACKAGE...]
#   --run     only what building and running need, without what tests and plots need
#   --mpi     also MPI and PETSc, for many machines (cmake --preset mpi)
#   --slurm   also a Slurm for the tests of tools/batch.slurm (tests/slurm)
set -euo pipefail

packages=(gcc gfortran cmake ninja-build libsuitesparse-dev libmetis-dev libhdf5-dev libopenblas-pthread-dev libmuparser-dev
  gmsh python3 python3-h5py python3-numpy python3-meshio)
tests=(python3-scipy python3-matplotlib python3-vtk9 xvfb xauth man-db bash-completion)
while [[ ${1:-} == --* ]]; do
  case $1 in
    --run) tests=() ;;
    --mpi) packages+=(libopenmpi-dev openmpi-bin libhdf5-openmpi-dev libpetsc-real-dev pkg-config) ;;
    --slurm) packages+=(slurmctld slurmd slurm-client munge) ;;
    *) echo "setup: no option $1" >&2; exit 2 ;;
  esac
  shift
done
packages+=("${tests[@]}" "$@")

if ! command -v dpkg-query > /dev/null; then
  echo "setup: this is not Debian; needed are the equivalents of: ${packages[*]}" >&2
  exit 0
fi
installed=" $(dpkg-query -W -f '${Package}=${db:Status-Status} ' "${packages[@]}" 2> /dev/null || true) "
missing=()
for package in "${packages[@]}"; do
  [[ $installed == *" $package=installed "* ]] || missing+=("$package")
done
if ((${#missing[@]} == 0)); then
  echo "setup: all ${#packages[@]} packages are installed" >&2
  exit 0
fi

echo "setup: installing ${missing[*]}" >&2
as_root=()
if ((EUID != 0)); then
  if ! command -v sudo > /dev/null; then
    echo "setup: neither root nor sudo; please have these packages installed: ${missing[*]}" >&2
    exit 1
  fi
  as_root=(sudo)
fi
log=$(mktemp)
trap 'rm -f "$log"' EXIT
apt() {
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -q -y -o DPkg::Lock::Timeout=600 "$@" < /dev/null >> "$log" 2>&1
}
# A list that cannot be brought up to date may still do; what counts is whether the packages come.
apt update || echo "setup: apt-get update failed; trying with the lists that are there" >&2
if ! apt install --no-install-recommends "${missing[@]}"; then
  tail -n 30 "$log" >&2
  echo "setup: these packages could not be installed: ${missing[*]}" >&2
  exit 1
fi
