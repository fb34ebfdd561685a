"""Draw a scene's file as three.js shows it, by the camera of its TOML: python -m benchmarks.scenes.picture.

    wizen scene examples/scenes/bowl.toml --out bowl.glb
    python -m benchmarks.scenes.picture examples/scenes/bowl.toml bowl.glb docs/scenes-bowl.png

three.js and its decoder are the page's own (`make page`); the browser is Chromium, without a graphics card.
"""

from __future__ import annotations

import argparse
import io
import json
import shutil
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING

from service.page import BUILT

if TYPE_CHECKING:
    from playwright.sync_api import Route

__all__ = ["FLAGS", "draw"]

#: Draws in software, the same on every machine.
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
_PAGE = """<!doctype html><style>body { margin: 0 }</style><canvas id="view"></canvas><script type="importmap">
{"imports": {"three": "/three/build/three.module.js", "three/addons/": "/three/examples/jsm/"}}</script>
<script type="module">
import * as T from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { RoomEnvironment } from "three/addons/environments/RoomEnvironment.js";
import { MeshoptDecoder } from "three/addons/libs/meshopt_decoder.module.js";
const { camera, unit, width, height } = SCENE;
const renderer = new T.WebGLRenderer({ canvas: document.getElementById("view"), antialias: true });
renderer.setSize(width, height);
renderer.shadowMap.enabled = true;
renderer.toneMapping = T.ACESFilmicToneMapping;
renderer.toneMappingExposure = 0.78;
const scene = new T.Scene();
scene.environment = new T.PMREMGenerator(renderer).fromScene(new RoomEnvironment(), 0.04).texture;
scene.environmentIntensity = 0.6;
const loaded = await new GLTFLoader().setMeshoptDecoder(MeshoptDecoder).loadAsync("/scene.glb");
loaded.scene.scale.setScalar(1 / unit);
loaded.scene.traverse((one) => {
  if (one.isMesh) one.castShadow = one.receiveShadow = true;
  one.frustumCulled = false;
});
const eye = new T.PerspectiveCamera(camera.fov, width / height, 0.1, 1000);
eye.position.fromArray(camera.position);
const away = eye.position.distanceTo(new T.Vector3().fromArray(camera.target));
eye.lookAt(...camera.target);
const sun = new T.DirectionalLight("#fff1dd", 2.6);
sun.position.set(-0.39, 0.74, 0.3).multiplyScalar(away);
sun.castShadow = true;
sun.shadow.mapSize.set(2048, 2048);
const wide = 0.48 * away;
const frustum = { left: -wide, right: wide, top: wide, bottom: -wide, near: 0.05 * away, far: 2.2 * away };
Object.assign(sun.shadow.camera, frustum);
sun.shadow.bias = -0.0006;
sun.shadow.normalBias = 0.0013 * away;
const wood = new T.MeshStandardMaterial({ color: "#c9b08d", roughness: 0.9 });
const floor = new T.Mesh(new T.PlaneGeometry(9 * away, 9 * away), wood);
floor.rotation.x = -Math.PI / 2;
floor.position.y = new T.Box3().setFromObject(loaded.scene).min.y;
floor.receiveShadow = true;
scene.add(loaded.scene, sun, floor);
renderer.render(scene, eye);
document.title = "drawn";
</script>"""


def draw(file: Path, glb: Path, out: Path, width: int = 800) -> None:
    """Write the picture (PNG of 256 colours) that a scene's camera takes of its file.

    Raises:
        FileNotFoundError: there is no Chromium, or the page was never built.

    """
    from PIL import Image
    from playwright.sync_api import sync_playwright

    three = BUILT.parent / "node_modules" / "three"
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    if chromium is None or not three.is_dir():
        raise FileNotFoundError("Chromium and the page's packages are needed: apt-get install chromium, make page.")
    said = tomllib.loads(file.read_text(encoding="utf-8"))
    camera = said["camera"]
    height = round(width * camera["height"] / camera["width"])
    scene = {"camera": camera, "unit": said.get("unit", 1.0), "width": width, "height": height}

    def answer(route: Route) -> None:
        name = route.request.url.split("/", 3)[3]
        if name == "":
            route.fulfill(body=_PAGE.replace("SCENE", json.dumps(scene), 1), content_type="text/html")
        elif name == "scene.glb":
            route.fulfill(path=glb, content_type="model/gltf-binary")
        elif name.startswith("three/"):
            route.fulfill(path=three.parent / name, content_type="text/javascript")
        else:
            route.fulfill(status=404)

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=chromium, args=FLAGS)
        page = browser.new_page(viewport={"width": width, "height": height})
        page.route("**/*", answer)
        page.goto("http://scene.invalid/")
        page.wait_for_function("document.title == 'drawn'", timeout=180_000)
        picture = page.screenshot()
        browser.close()
    Image.open(io.BytesIO(picture)).convert("RGB").quantize(256).save(out, optimize=True)


def main() -> None:
    """Draw what the command line names."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path, help="the scene's TOML, for its camera")
    parser.add_argument("glb", type=Path, help="the scene's file")
    parser.add_argument("out", type=Path, help="the picture")
    parser.add_argument("--width", type=int, default=800, help="of the picture [pixel]")
    given = parser.parse_args()
    draw(given.scene, given.glb, given.out, given.width)


if __name__ == "__main__":
    main()
