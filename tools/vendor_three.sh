#!/usr/bin/env bash
# Bundles three.js for the HTML viewer: fetches `three` and `esbuild` from npm at the versions below into a temporary
# folder, and writes crates/omnix-io/assets/three/: three.min.js (the names of entry.js, tree-shaken and minified into a
# classic script that sets the global THREE, so that it runs from file://), LICENSE and VERSION. Not part of any build:
# run it to move to another version, look at the viewer, and commit what it wrote. Needs node and npm.
set -euo pipefail
three=0.187.0
esbuild=0.28.2

cd "$(dirname "$0")/../crates/omnix-io/assets/three"
out=$PWD
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cp entry.js "$scratch/"
cd "$scratch"
printf '{ "private": true }\n' >package.json
npm install --silent --no-audit --no-fund --save-exact "three@$three" "esbuild@$esbuild"
npx --no-install esbuild entry.js --bundle --minify --format=iife --global-name=THREE --target=es2020 --charset=ascii \
    --legal-comments=none --outfile=three.min.js --log-level=warning
# It is written into an HTML script element, which these would end.
if grep -qiE '</script|<!--' three.min.js; then
    printf 'vendor_three: the bundle holds text that ends a script element\n' >&2
    exit 1
fi
{
    printf '/*! three.js %s, https://threejs.org, MIT licence, copyright 2010-2026 three.js authors */\n' "$three"
    cat three.min.js
} >"$out/three.min.js"
cp node_modules/three/LICENSE "$out/LICENSE"
printf 'three.js %s, bundled with esbuild %s by tools/vendor_three.sh\n' "$three" "$esbuild" >"$out/VERSION"
ls -l "$out"
