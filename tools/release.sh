#!/bin/bash
# Makes a release of what is committed: checks, tests, source archive, package for Debian, and, last, the tag.
# usage: tools/release.sh [--no-tests] [--no-tag]
#   --no-tests   without tools/test.sh and tools/check.sh
#   --no-tag     all but the tag, to try it
# Before it, commit the version in CMakeLists.txt, the version and the date in CITATION.cff, and the entries of CHANGELOG.md
# under `## [VERSION] - DATE`, with none left under Unreleased. The files are made from the archive alone in build/dist.
# DEBFULLNAME and DEBEMAIL name the maintainer of the package; if absent, the user of git. Nothing is pushed.
set -euo pipefail

tools=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
cd "$tools/.."
refuse() {
  echo "release: $*" >&2
  exit 1
}
tests=true tag=true
for option in "$@"; do
  case $option in
    --no-tests) tests=false ;;
    --no-tag) tag=false ;;
    *) sed -n '2,8s/^# \?//p' "${BASH_SOURCE[0]}" >&2; exit 2 ;;
  esac
done

version=$(sed -nE 's/^project\(dotyk VERSION ([0-9.]+).*/\1/p' CMakeLists.txt)
date=$(sed -nE "s/^## \[${version//./\\.}\] - ([0-9-]+)$/\1/p" CHANGELOG.md)
[[ -z $(git status --porcelain) ]] || refuse "there are changes that are not committed: git status lists them"
[[ -n $date ]] || refuse "CHANGELOG.md has no '## [$version] - DATE', the version in CMakeLists.txt"
[[ $(grep '^## \[' CHANGELOG.md | head -n 1) == "## [$version]"* ]] || refuse "CHANGELOG.md has a later version than $version, that in CMakeLists.txt"
[[ -z $(sed -n '/^## Unreleased/,/^## \[/{/^- /p}' CHANGELOG.md) ]] || refuse "CHANGELOG.md has entries under Unreleased: put them under [$version]"
grep -qx "version: $version" CITATION.cff || refuse "CITATION.cff has another version than $version, that in CMakeLists.txt"
grep -qx "date-released: $date" CITATION.cff || refuse "CITATION.cff has another date than $date, that in CHANGELOG.md"
! git rev-parse --quiet --verify "refs/tags/v$version" > /dev/null || refuse "there is a tag v$version: set a new version in CMakeLists.txt"

if $tests; then
  "$tools/test.sh" || refuse "tests failed; no files were made"
  "$tools/check.sh" lint werror package || refuse "checks failed; no files were made"
fi

# From the archive, so that nothing is in the package that is not in the archive.
"$tools/setup.sh" --run dpkg-dev lintian
dist=build/dist name=dotyk-$version
rm -rf "$dist"
mkdir -p "$dist"
git archive --format=tar.gz --prefix="$name/" --output="$dist/$name.tar.gz" HEAD
tar -xzf "$dist/$name.tar.gz" -C "$dist"
export DEBFULLNAME=${DEBFULLNAME:-$(git config user.name)} DEBEMAIL=${DEBEMAIL:-$(git config user.email)}
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct)
export SOURCE_DATE_EPOCH
{
  cmake -S "$dist/$name" -B "$dist/build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DDOTYK_TESTS=OFF
  cmake --build "$dist/build"
  (cd "$dist/build" && cpack -G DEB)
} > "$dist/build.log" 2>&1 || refuse "the package could not be built: $PWD/$dist/build.log"
mv "$dist/build"/*.deb "$dist"
as_root=()
((EUID != 0)) || as_root=(--allow-root)
lintian "${as_root[@]}" --fail-on error,warning "$dist"/*.deb || refuse "lintian is not content with the package"
rm -rf "${dist:?}/build" "${dist:?}/$name"
(cd "$dist" && sha256sum -- *.tar.gz *.deb > SHA256SUMS && cat SHA256SUMS)

if $tag; then
  git tag --annotate --message="dotyk $version" "v$version"
  echo "release: tagged v$version; to publish: git push origin v$version, with the files of $dist" >&2
else
  echo "release: version $version could be tagged; its files are in $dist" >&2
fi
