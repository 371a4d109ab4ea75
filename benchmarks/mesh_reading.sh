#!/bin/bash
# Times the reading of a mesh of a million tetrahedra in gmsh's four formats, beside `cat` and numpy's conversion of the same text.
# usage: benchmarks/mesh_reading.sh [FOLDER]     keeps the meshes (190 MB) in FOLDER; a temporary one is removed
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
build=$root/build/release
if (($# > 0)); then
  folder=$1
  mkdir -p "$folder"
else
  folder=$(mktemp -d)
  trap 'rm -rf "$folder"' EXIT
fi
"$root/tools/build.sh" release
gfortran -O2 -I"$build/modules/mesh" -I"$build/modules/base" "$root/benchmarks/mesh_reading.f90" \
  -o "$folder/benchmark" "$build/libdotyk_mesh.a" "$build/libdotyk_base.a" -lmuparser

cat > "$folder/cube.geo" << 'END'
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 1, 1, 1};
Physical Volume("cube") = {1};
Physical Surface("bottom") = {5};
Mesh.MeshSizeMin = 1/64;
Mesh.MeshSizeMax = 1/64;
END
formats=(msh41.bin msh22.bin msh41 msh22)
for format in "${formats[@]}"; do
  file=$folder/cube.$format.msh
  binary=()
  [[ $format == *.bin ]] && binary=(-bin)
  if [[ ! -s $file && $format == msh41.bin ]]; then
    gmsh -3 -algo hxt -format msh41 -bin -o "$file" "$folder/cube.geo" > "$folder/gmsh.log"
  elif [[ ! -s $file ]]; then
    gmsh -save -format "${format%.bin}" "${binary[@]}" -o "$file" "$folder/cube.msh41.bin.msh" >> "$folder/gmsh.log"
  fi
done

# Wall seconds of the fastest of three runs.
seconds() {
  local best=999 start end
  for _ in 1 2 3; do
    start=$(date +%s.%N)
    "$@" > /dev/null
    end=$(date +%s.%N)
    best=$(awk -v b="$best" -v s="$start" -v e="$end" 'BEGIN { t = e - s; print (t < b) ? t : b }')
  done
  echo "$best"
}
numpy_reading='
import sys, time
import numpy
with open(sys.argv[1], "rb") as file:
    text = file.read()
text = text[text.index(b"$Nodes") + 6:text.index(b"$EndElements")].replace(b"$EndNodes", b" ").replace(b"$Elements", b" ")
start = time.time()
numpy.fromstring(text, sep=" ")
print("%.3f" % (time.time() - start))'

printf '%-10s %8s %9s %10s %10s %8s %9s %9s\n' format MB seconds elements nodes cat x_cat x_numpy
for format in "${formats[@]}"; do
  file=$folder/cube.$format.msh
  read -r time elements nodes < <("$folder/benchmark" "$file")
  cat_time=$(seconds cat "$file")
  numpy_ratio=-
  if [[ $format != *.bin ]] && python=$("$root/tools/python.sh" -W ignore -c "$numpy_reading" "$file" 2> /dev/null); then
    numpy_ratio=$(awk -v a="$time" -v b="$python" 'BEGIN { printf "%.2f", a/b }')
  fi
  printf '%-10s %8.1f %9.3f %10d %10d %8.3f %9.1f %9s\n' "$format" "$(awk -v b="$(stat -c %s "$file")" 'BEGIN { print b/1e6 }')" \
    "$time" "$elements" "$nodes" "$cat_time" "$(awk -v a="$time" -v b="$cat_time" 'BEGIN { print a/b }')" "$numpy_ratio"
done
