/** Chromium without a window, whose pages run what npm has installed. */
import { execFileSync } from "node:child_process";
import { readFile } from "node:fs/promises";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";
import { chromium } from "playwright-core";

import { CAMERA, ROOT } from "./ghand.mjs";
import { picture } from "./picture.mjs";

const NAMES = ["chromium", "chromium-browser", "google-chrome"];
/** Longest wait for a page or its picture, milliseconds: software draws slowly where other programs run, too. */
const PATIENCE = 120_000;
/** Everything is drawn by SwiftShader: the same pixels on every machine. */
const FLAGS = [
  "--headless=new", "--no-sandbox", "--ignore-gpu-blocklist", "--enable-unsafe-swiftshader", "--no-first-run",
  "--disable-background-networking", "--disable-quic", "--disable-component-update", "--disable-sync",
];
/** A canvas of WebGPU can be photographed only where WebGL does not work. */
const APIS = {
  webgl: ["--use-gl=angle", "--use-angle=swiftshader"],
  webgpu: [
    "--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader", "--enable-features=Vulkan",
    "--use-vulkan=swiftshader", "--use-angle=vulkan",
  ],
};
const SCRIPT = "text/javascript";
const TYPES = { ".html": "text/html", ".js": SCRIPT, ".mjs": SCRIPT, ".wasm": "application/wasm" };

/** The browser's program; nothing where there is none. */
export const BROWSER = NAMES.find((name) => {
  try {
    execFileSync(name, ["--version"], { stdio: "ignore" });
    return true;
  } catch {
    return false;
  }
});
/** Of a test: why it is skipped. */
export const WITHOUT_BROWSER = BROWSER ? false : "Chromium is not installed";

async function respond(request, response) {
  const path = normalize(decodeURIComponent(new URL(request.url, "http://localhost").pathname));
  try {
    const bytes = await readFile(join(ROOT, path));
    response.writeHead(200, { "content-type": TYPES[extname(path)] ?? "application/octet-stream" }).end(bytes);
  } catch {
    response.writeHead(404).end();
  }
}

/** Opens the browser for the time of `use`, which gets `Pages` that draw by `api`, a name of `APIS`. */
export async function withBrowser(api, use) {
  const server = createServer(respond);
  await new Promise((listening) => server.listen(0, "127.0.0.1", listening));
  const executablePath = execFileSync("which", [BROWSER], { encoding: "utf8" }).trim();
  const browser = await chromium.launch({ executablePath, args: [...FLAGS, ...APIS[api]] });
  try {
    return await use(new Pages(browser, `http://127.0.0.1:${server.address().port}`));
  } finally {
    await browser.close();
    server.close();
  }
}

class Pages {
  constructor(browser, origin) {
    this.browser = browser;
    this.origin = origin;
  }

  /** Opens a page for the time of `use`. What the page itself throws is an error. */
  async page(use, size = CAMERA) {
    const page = await this.browser.newPage({ viewport: { width: size.width, height: size.height } });
    page.setDefaultTimeout(PATIENCE);
    let late;
    const thrown = new Promise((_, fail) => {
      page.on("pageerror", fail);
      late = setTimeout(() => fail(new Error("the page takes too long")), PATIENCE);
    });
    thrown.catch(() => {});
    try {
      return await Promise.race([use(page), thrown]);
    } finally {
      clearTimeout(late);
      await page.close();
    }
  }

  /** The picture of a program in `pages/` with these options. */
  draw(program, options) {
    return this.page(async (page) => {
      await page.goto(`${this.origin}/suite/pages/page.html`);
      const draw = async ([program, options]) => (await import(`./${program}.js`)).draw(options);
      await page.evaluate(draw, [program, { camera: CAMERA, ...options }]);
      return still(() => page.screenshot());
    });
  }
}

/** A picture, once `photograph` gives the same thrice: splats are sorted by workers. */
export async function still(photograph) {
  let [last, equal] = [Buffer.alloc(0), 0];
  for (let tries = 0; equal < 2; tries++) {
    if (tries === 40) throw new Error("the page's picture does not come to rest");
    await new Promise((later) => setTimeout(later, 150));
    const next = await photograph();
    equal = next.equals(last) ? equal + 1 : 0;
    last = next;
  }
  return picture(last);
}
