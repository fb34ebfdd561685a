"""A picture of a scene's file as three.js shows it: python -m benchmarks.scenes.picture SCENE.glb FILE.png.

Needs the page's libraries (`make page`), the extra `browser`, and a Chromium.
"""

from __future__ import annotations

import argparse
import base64
import functools
import http.server
import json
import shutil
import tempfile
import threading
from pathlib import Path

from playwright.sync_api import sync_playwright

from benchmarks.figures import ROOT

LIBRARIES = ROOT / "service/viewer/node_modules/three"
PAGE = """<!doctype html><title></title><style>body {margin: 0}</style>
<script type="importmap">
{"imports": {"three": "/three/build/three.module.js", "three/": "/three/examples/jsm/"}}
</script>
<script type="module">
import * as T from "three";
import { GLTFLoader } from "three/loaders/GLTFLoader.js";
import { MeshoptDecoder } from "three/libs/meshopt_decoder.module.js";
import { RoomEnvironment } from "three/environments/RoomEnvironment.js";
const {position, target, fov, size: [w, h]} = SAID;
const drawn = new T.WebGLRenderer({antialias: true, preserveDrawingBuffer: true});
drawn.setSize(w, h); drawn.toneMapping = T.ACESFilmicToneMapping; drawn.shadowMap.enabled = true;
document.body.append(drawn.domElement);
const scene = new T.Scene(); scene.background = new T.Color(0xd8d2c8);
scene.environment = new T.PMREMGenerator(drawn).fromScene(new RoomEnvironment(), 0.04).texture;
scene.environmentIntensity = 0.55;
const camera = new T.PerspectiveCamera(fov, w / h, 0.001, 1000);
camera.position.set(...position); camera.lookAt(...target);
new GLTFLoader().setMeshoptDecoder(MeshoptDecoder).load("/scene.glb", (file) => {
  scene.add(file.scene);
  const box = new T.Box3().setFromObject(file.scene), middle = box.getCenter(new T.Vector3());
  const d = box.getSize(new T.Vector3()).length();
  const sun = new T.DirectionalLight(0xfff2e0, 2.5);
  sun.position.copy(middle).add(new T.Vector3(0.6 * d, 1.2 * d, 0.5 * d)); sun.target.position.copy(middle);
  sun.castShadow = true; sun.shadow.mapSize.set(2048, 2048); sun.shadow.bias = -0.001;
  Object.assign(sun.shadow.camera, {left: -d, right: d, top: d, bottom: -d, near: 0.01 * d, far: 4 * d});
  const paint = new T.MeshStandardMaterial({color: 0xa89078, roughness: 0.9});
  const floor = new T.Mesh(new T.PlaneGeometry(40 * d, 40 * d), paint);
  floor.rotation.x = -Math.PI / 2; floor.receiveShadow = true;
  scene.add(sun, sun.target, floor);
  file.scene.traverse((one) => { if (one.isMesh) one.castShadow = one.receiveShadow = true; });
  drawn.render(scene, camera); drawn.render(scene, camera);
  document.title = drawn.domElement.toDataURL("image/png");
}, undefined, (error) => { document.title = "failed: " + error; });
</script>"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--position", type=float, nargs=3, default=(0.0, 0.19, 0.13), help="of the camera [m]")
    parser.add_argument("--target", type=float, nargs=3, default=(0.0, 0.016, 0.004), help="of the camera [m]")
    parser.add_argument("--fov", type=float, default=36.0, help="vertical [degree]")
    parser.add_argument("--size", type=int, nargs=2, default=(800, 500), help="pixels")
    asked = parser.parse_args()
    said = {name: getattr(asked, name) for name in ("position", "target", "fov", "size")}
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        (root / "three").symlink_to(LIBRARIES)
        shutil.copy(asked.scene, root / "scene.glb")
        (root / "index.html").write_text(PAGE.replace("SAID", json.dumps(said)))
        handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=folder)
        server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        asked.out.write_bytes(_drawn(f"http://127.0.0.1:{server.server_port}/index.html", asked.size))


def _drawn(address: str, size: tuple[int, int]) -> bytes:
    flags = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=shutil.which("chromium"), args=flags)
        page = browser.new_page(viewport={"width": size[0], "height": size[1]})
        page.goto(address, wait_until="commit", timeout=300_000)
        page.wait_for_function("document.title != ''", timeout=600_000)
        title = page.title()
        browser.close()
    if not title.startswith("data:"):
        raise SystemExit(title)
    return base64.b64decode(title.split(",")[1])


if __name__ == "__main__":
    main()
