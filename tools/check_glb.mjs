// Runs the Khronos glTF validator on .glb files: node check_glb.mjs FILE...
// Needs the npm package gltf-validator, found beside this script, in the working folder or in a folder of NODE_PATH.
// Exit code 0: no errors and no warnings; 1: some; 2: the validator is not installed.

import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { delimiter, join } from "node:path";

function findValidator() {
  const places = [import.meta.url, join(process.cwd(), "x.js")];
  for (const folder of (process.env.NODE_PATH ?? "").split(delimiter).filter(Boolean)) {
    places.push(join(folder, "..", "x.js"));
  }
  for (const place of places) {
    try {
      return createRequire(place)("gltf-validator");
    } catch {
      // Not there: look in the next place.
    }
  }
  return null;
}

const validator = findValidator();
if (!validator) {
  console.error("gltf-validator is not installed: npm install gltf-validator");
  process.exit(2);
}
let bad = 0;
for (const file of process.argv.slice(2)) {
  const report = await validator.validateBytes(new Uint8Array(readFileSync(file)), { maxIssues: 20 });
  const { numErrors, numWarnings, numInfos, numHints, messages } = report.issues;
  const { totalVertexCount, drawCallCount } = report.info;
  console.log(`${numErrors} errors, ${numWarnings} warnings, ${numInfos} infos, ${numHints} hints; ` +
    `${totalVertexCount} vertices, ${drawCallCount} primitives`);
  for (const message of messages) {
    console.log(`  ${message.code} ${message.message} ${message.pointer ?? ""}`);
  }
  bad += numErrors + numWarnings;
}
process.exit(bad === 0 ? 0 : 1);
