#!/usr/bin/env bash
# Builds the book of docs/ with mdBook (cargo install mdbook) into target/book/html.
#
#   docs/build.sh          then open target/book/html/index.html
#
# SUMMARY.md also lists pages outside of docs/. The sources are therefore copied to target/book/src, at their paths in
# the repository, so that relative links lead to the same files there and here.
set -euo pipefail
cd "$(dirname "$0")/.."
command -v mdbook >/dev/null || { echo "docs/build.sh: mdbook is missing: cargo install mdbook --locked" >&2; exit 2; }
book=target/book
rm -rf "$book"
mkdir -p "$book/src"
git ls-files -z '*.md' docs/pictures docs/wiring arrays config crates/sonard-model/src/lib.rs examples python/gallery \
  scenes sensors systemd 'LICENSE-*' |
  xargs -0 cp --parents -t "$book/src"
# Paths from docs/ become paths from the top folder.
sed -E 's#\]\(#](docs/#; s#\]\(docs/\.\./#](#' docs/SUMMARY.md >"$book/src/SUMMARY.md"
rm "$book/src/docs/SUMMARY.md"
# There the table of contents is the sidebar.
sed -i -E 's#\[([^]]*)\]\(docs/SUMMARY.md\)#\1#' "$book/src/README.md" "$book/src/CONTRIBUTING.md"
mdbook build docs
# Every local link of every page has a file.
python3 docs/check_html.py "$book/html"
