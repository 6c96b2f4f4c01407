// Builds the page into p2os/view/bundle, or with --check says whether what is committed there is what is built.
//
// page.js      everything but 3D, run as it stands in a script element
// scene.js     three and the 3D view: loaded when that view opens
// page.css     the styles of all
// index.html    the document with its places
// licenses.txt the licences of the packages that are in the two scripts
import { build } from "esbuild";
import { existsSync, readFileSync, readdirSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { gzipSync } from "node:zlib";

const HERE = dirname(fileURLToPath(import.meta.url));
const BUNDLE = join(HERE, "..", "..", "p2os", "view", "bundle");
/** What the page may weigh, gzip. */
const MOST_BYTES = 1_500_000;

/** The dock's own themes are most of its style sheet, and the page has another one. */
const withoutThemes = {
  name: "without-themes",
  setup: ({ onLoad }) => onLoad({ filter: /dockview\.css$/ }, ({ path }) => {
    const rules = readFileSync(path, "utf8").replace(/\/\*[\s\S]*?\*\//g, "").split(/(?<=\})\n(?=\S)/);
    const isTheme = (rule) => /^\s*[^{@]*\{/.test(rule) && rule.slice(0, rule.indexOf("{")).split(",").every((selector) => selector.includes(".dockview-theme-"));
    return { contents: rules.filter((rule) => !isTheme(rule)).join("\n"), loader: "css" };
  }),
};

const common = {
  absWorkingDir: HERE, preserveSymlinks: true, bundle: true, minify: true, write: false, metafile: true, format: "iife", target: "es2022", charset: "utf8",
  legalComments: "none", jsx: "automatic", jsxImportSource: "preact", define: { "process.env.NODE_ENV": '"production"' }, logLevel: "warning", plugins: [withoutThemes],
};

async function built() {
  const files = new Map(), packages = new Set();
  for (const entry of [{ page: "src/main.tsx" }, { scene: "src/scene.ts" }]) {
    const result = await build({ ...common, entryPoints: entry, outdir: "out" });
    for (const file of result.outputFiles) files.set(file.path.split(/[\\/]/).at(-1), Buffer.from(file.contents));
    for (const input of Object.keys(result.metafile.inputs)) {
      const found = /^node_modules\/((?:@[^/]+\/)?[^/]+)\//.exec(input);
      if (found) packages.add(found[1]);
    }
  }
  files.set("index.html", readFileSync(join(HERE, "index.html")));
  files.set("licenses.txt", Buffer.from([...packages].sort().map(licence).join("\n")));
  return files;
}

function licence(name) {
  const folder = join(HERE, "node_modules", name), about = JSON.parse(readFileSync(join(folder, "package.json"), "utf8"));
  let from = folder;
  let file = readdirSync(from).find((entry) => /^licen[cs]e/i.test(entry));
  if (!file) throw new Error(`${name} ships no licence text`);
  const text = readFileSync(join(from, file), "utf8").replace(/\r\n/g, "\n").trim();
  return `${name} ${about.version} (${about.license})\n\n${text}\n`;
}

const files = await built();
const weight = [...files].filter(([name]) => /\.(js|css)$/.test(name)).reduce((sum, [, bytes]) => sum + gzipSync(bytes, { level: 9 }).length, 0);
for (const [name, bytes] of files) console.log(`${name.padEnd(14)}${bytes.length.toString().padStart(9)} bytes${gzipSync(bytes, { level: 9 }).length.toString().padStart(9)} gzip`);
if (weight > MOST_BYTES) {
  console.error(`page: ${weight} bytes compressed, more than ${MOST_BYTES}`);
  process.exit(1);
}
if (process.argv.includes("--check")) {
  const stale = [...files].filter(([name, bytes]) => !existsSync(join(BUNDLE, name)) || !readFileSync(join(BUNDLE, name)).equals(bytes)).map(([name]) => name);
  const unknown = existsSync(BUNDLE) ? readdirSync(BUNDLE).filter((name) => !files.has(name) && !/^__|\.py$/.test(name)) : [];
  if (stale.length || unknown.length) {
    console.error(`page: p2os/view/bundle is not what tools/page builds: ${[...stale, ...unknown].join(", ")} (hint: make page)`);
    process.exit(1);
  }
  console.log("page: p2os/view/bundle is what tools/page builds");
} else {
  const { mkdirSync } = await import("node:fs");
  mkdirSync(BUNDLE, { recursive: true });
  for (const [name, bytes] of files) writeFileSync(join(BUNDLE, name), bytes);
}
