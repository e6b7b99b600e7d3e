// A baked glb in three.js beside `photoncard render`: errors of pixels away from silhouettes.
//
//     node bake_three.mjs PHOTONCARD SCENE BAKED.glb FOLDER VIEW... [-- OPTION...]
//
// A view is X,Y,Z:X,Y,Z:FOV: the camera, the point that it looks at, and the vertical field of view. Options go to
// `photoncard render`, whose pictures stay in FOLDER for later runs of the same program, scene file, view and options. three.js and playwright-core are
// those of FOLDER/node_modules, Chromium is /usr/bin/chromium or $CHROMIUM.
// The page has no lights, no tone mapping and no environment; pixels are read back from a float target, linear.
// Prints for each view: mean over the render's, and percentiles of the error relative to the local mean, also of means over the 5x5
// pixels around each, in which less of the render's noise is left.
// FOLDER has PNGs: view-N-render, view-N-emissive and view-N-errors, red where the bake is too bright and blue where it is too dark,
// full at 20 %, black where pixels do not count.
import { execFileSync } from 'node:child_process';
import { createHash } from 'node:crypto';
import { createServer } from 'node:http';
import { readFileSync, writeFileSync, existsSync } from 'node:fs';
import { createRequire } from 'node:module';
import { extname, join, resolve } from 'node:path';

const WIDTH = 240, HEIGHT = 180;
const dash = process.argv.indexOf('--');
const words = process.argv.slice(2, dash < 0 ? undefined : dash);
const options = dash < 0 ? [] : process.argv.slice(dash + 1);
const [photoncard, scene, baked, folderName, ...views] = words;
if (!views.length) {
    console.error('usage: node bake_three.mjs PHOTONCARD SCENE BAKED.glb FOLDER X,Y,Z:X,Y,Z:FOV... [-- OPTION...]');
    process.exit(2);
}
const folder = resolve(folderName);
const { chromium } = createRequire(join(folder, 'x.js'))('playwright-core');

const page = `<!doctype html><script type="importmap">{"imports":{"three":"/node_modules/three/build/three.module.js",
"three/addons/":"/node_modules/three/examples/jsm/"}}</script><canvas id=c></canvas><script type=module>
import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { EXRLoader } from 'three/addons/loaders/EXRLoader.js';
const W = ${WIDTH}, H = ${HEIGHT};
const renderer = new THREE.WebGLRenderer({ canvas: document.getElementById('c'), antialias: false });
renderer.setSize(W, H, false);
renderer.toneMapping = THREE.NoToneMapping;
window.load = async () => {
    const gltf = await new GLTFLoader().loadAsync('/baked.glb');
    window.model = gltf.scene;
    window.scene3 = new THREE.Scene();
    scene3.add(gltf.scene);
};
// The same light as KHR_materials_unlit would show it: a base colour of at most 1 times the texture.
window.unlit = () => model.traverse(node => {
    if (!node.isMesh || !node.material.emissiveMap) return;
    const strength = node.material.emissiveIntensity ?? 1;
    node.material = new THREE.MeshBasicMaterial({ map: node.material.emissiveMap, side: node.material.side,
        color: new THREE.Color().setScalar(Math.min(strength, 1)) });
});
window.show = async (at, to, fov, exr) => {
    const camera = new THREE.PerspectiveCamera(fov, W / H, 0.01, 1000);
    camera.position.set(...at);
    camera.lookAt(...to);
    const target = new THREE.WebGLRenderTarget(W, H, { type: THREE.FloatType, samples: 0 });
    renderer.setRenderTarget(target);
    renderer.render(scene3, camera);
    const own = new Float32Array(W * H * 4);
    renderer.readRenderTargetPixels(target, 0, 0, W, H, own);
    renderer.setRenderTarget(null);
    renderer.render(scene3, camera);
    const png = renderer.domElement.toDataURL('image/png');
    const texture = await new EXRLoader().setDataType(THREE.FloatType).loadAsync(exr);
    // Both are rows from the bottom.
    return { png, own: Array.from(own), other: Array.from(texture.image.data) };
};
window.paint = shares => {
    const canvas = Object.assign(document.createElement('canvas'), { width: W, height: H });
    const image = new ImageData(W, H);
    shares.forEach((share, index) => {
        const shown = share === null ? 0 : 255 - Math.min(255, Math.abs(share) / 0.2 * 255);
        const colour = share === null ? [0, 0, 0] : share > 0 ? [255, shown, shown] : [shown, shown, 255];
        const [x, y] = [index % W, H - 1 - Math.floor(index / W)];
        image.data.set([...colour, 255], 4 * (y * W + x));
    });
    canvas.getContext('2d').putImageData(image, 0, 0);
    return canvas.toDataURL('image/png');
};
window.ready = true;
</script>`;

const files = { '/baked.glb': resolve(baked) };
const server = createServer((request, response) => {
    const path = decodeURIComponent(request.url.split('?')[0]);
    if (path === '/') return response.setHeader('content-type', 'text/html').end(page);
    if (path === '/favicon.ico') return response.writeHead(204).end();
    const file = files[path] ?? (path.startsWith('/node_modules/') ? join(folder, path) : null);
    if (!file || !existsSync(file)) return response.writeHead(404).end();
    const types = { '.js': 'text/javascript', '.mjs': 'text/javascript' };
    response.setHeader('content-type', types[extname(file)] ?? 'application/octet-stream');
    response.end(readFileSync(file));
}).listen(0);

/** Pixels whose neighbours in the render, two pixels around, all differ by less than a sixth: no silhouette or edge of a texture. */
function smooth(light, x, y) {
    const at = (x, y) => [0, 1, 2].map(c => light[4 * (y * WIDTH + x) + c]);
    if (x < 2 || y < 2 || x >= WIDTH - 2 || y >= HEIGHT - 2) return false;
    const own = at(x, y), sum = own[0] + own[1] + own[2];
    for (let dy = -2; dy <= 2; dy++) for (let dx = -2; dx <= 2; dx++) {
        const other = at(x + dx, y + dy);
        const difference = own.reduce((sum, value, c) => sum + Math.abs(value - other[c]), 0);
        if (difference > sum / 6) return false;
    }
    return sum > 0;
}

/** Sum of the channels, averaged over the pixels at most `reach` away. */
function blurred(light, x, y, reach) {
    let sum = 0;
    for (let dy = -reach; dy <= reach; dy++) for (let dx = -reach; dx <= reach; dx++) {
        for (let c = 0; c < 3; c++) sum += light[4 * ((y + dy) * WIDTH + x + dx) + c];
    }
    return sum / (2 * reach + 1) ** 2;
}

/** Errors of smooth pixels, averaged over those at most `reach` away: of each, null where it does not count, and of all. */
function errors(own, other, reach) {
    const shares = new Array(WIDTH * HEIGHT).fill(null);
    let [a, b] = [0, 0];
    for (let y = 0; y < HEIGHT; y++) for (let x = 0; x < WIDTH; x++) {
        if (!smooth(other, x, y)) continue;
        const [mine, theirs] = [own, other].map(light => blurred(light, x, y, reach));
        [a, b] = [a + mine, b + theirs];
        shares[y * WIDTH + x] = (mine - theirs) / theirs;
    }
    const found = shares.filter(share => share !== null).map(Math.abs).sort((a, b) => a - b);
    if (!found.length) throw new Error('no pixel of the render is away from its silhouettes');
    const percentile = share => found[Math.min(found.length - 1, Math.floor(share * found.length))];
    return { shares, pixels: found.length, mean: a / b, median: percentile(0.5), p95: percentile(0.95), p99: percentile(0.99) };
}

function writePng(name, url) {
    writeFileSync(join(folder, name), Buffer.from(url.split(',')[1], 'base64'));
}

const browser = await chromium.launch({
    executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
    args: ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist',
        '--disable-background-networking'],
});
const tab = await browser.newPage();
tab.on('console', message => console.error('page:', message.text()));
tab.on('pageerror', error => console.error('page:', error.message));
await tab.goto(`http://127.0.0.1:${server.address().port}/`);
await tab.waitForFunction('window.ready', null, { timeout: 60000 });
await tab.evaluate('load()');
const shown = [];
for (const [number, view] of views.entries()) {
    const [at, to, fov] = view.split(':');
    const asked = ['render', scene, '--camera-at', at, '--look-at', to, '--fov', fov, '--size', `${WIDTH}x${HEIGHT}`,
        '--sample-type', 'float', ...options];
    const key = [photoncard, scene].reduce((sum, file) => sum.update(readFileSync(file)), createHash('sha256').update(JSON.stringify(asked)))
        .digest('hex').slice(0, 12);
    const exr = join(folder, `render-${key}.exr`);
    if (!existsSync(exr)) execFileSync(photoncard, [...asked, '--quiet', '-o', exr], { stdio: ['ignore', 'ignore', 'inherit'] });
    execFileSync(photoncard, ['tonemap', exr, '--tonemap', 'none', '-o', join(folder, `view-${number}-render.png`)], { stdio: 'inherit' });
    files[`/${number}.exr`] = exr;
    shown.push([at.split(',').map(Number), to.split(',').map(Number), Number(fov), `/${number}.exr`]);
}
for (const form of ['emissive', 'unlit']) {
    if (form === 'unlit') await tab.evaluate('unlit()');
    for (const [number, view] of shown.entries()) {
        const { png, own, other } = await tab.evaluate(view => show(...view), view);
        writePng(`view-${number}-${form}.png`, png);
        const { shares, pixels, mean, median, p95, p99 } = errors(own, other, 0), blocks = errors(own, other, 2);
        const percent = share => `${(100 * share).toFixed(2)} %`;
        console.log(`${form} view ${number}: ${pixels} pixels, mean ${percent(mean - 1)} off, median ${percent(median)}, ` +
            `95 % within ${percent(p95)}, 99 % within ${percent(p99)}; of blocks of 5x5, median ${percent(blocks.median)}, ` +
            `95 % within ${percent(blocks.p95)}`);
        if (form === 'emissive') writePng(`view-${number}-errors.png`, await tab.evaluate(shares => paint(shares), shares));
    }
}
await browser.close();
server.close();
