// Bundle web/src into the assets of hil/view, for the pages of hil view and of a running measurement:
// `make view-bundle`. A hash of the sources is kept, so that a test detects an outdated bundle without npm.
import { createHash } from 'node:crypto';
import { copyFileSync, readFileSync, readdirSync, writeFileSync } from 'node:fs';
import { build } from 'esbuild';

const assets = '../hil/view/assets';
await build({
  entryPoints: ['src/main.js'], outfile: `${assets}/view.js`, globalName: 'hilView',
  bundle: true, minify: true, format: 'iife', target: 'es2022', legalComments: 'none', charset: 'utf8',
  banner: { js: '/*! Contains three.js, Copyright 2010-2026 three.js authors, MIT licence: see three.LICENSE */' },
});
copyFileSync('node_modules/three/LICENSE', `${assets}/three.LICENSE`);
// checker of accessibility, used by the tests
copyFileSync('node_modules/axe-core/axe.min.js', '../tests/support/axe.min.js');
const hash = createHash('sha256');
const sources = readdirSync('src').map((name) => `src/${name}`);
for (const name of [...sources, 'build.mjs', 'package-lock.json'].sort()) {
  hash.update(name).update('\0').update(readFileSync(name)).update('\0');
}
writeFileSync(`${assets}/sources.sha256`, `${hash.digest('hex')}\n`);
