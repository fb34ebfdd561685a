// Skin: a physical material whose colour, roughness and bloom follow the relief, with pores too fine for the mesh.

import { Color, MeshPhysicalMaterial, type IUniform } from "three";
import type { Skin } from "./looks";

const NOISE = /* glsl */ `
varying float vRelief;
varying vec3 vRest;
uniform vec3 uRidge, uFurrow, uBloom;
uniform float uScale, uPores, uBloomAmount;
float hash(vec3 p) { p = fract(p * 0.3183099 + 0.1); p *= 17.0; return fract(p.x * p.y * p.z * (p.x + p.y + p.z)); }
// value noise and its gradient (Quilez)
vec4 noised(vec3 x) {
  vec3 i = floor(x), w = fract(x);
  vec3 u = w * w * w * (w * (w * 6.0 - 15.0) + 10.0);
  vec3 du = 30.0 * w * w * (w * (w - 2.0) + 1.0);
  float a = hash(i), b = hash(i + vec3(1, 0, 0)), c = hash(i + vec3(0, 1, 0)), d = hash(i + vec3(1, 1, 0));
  float e = hash(i + vec3(0, 0, 1)), f = hash(i + vec3(1, 0, 1)), g = hash(i + vec3(0, 1, 1)), h = hash(i + vec3(1, 1, 1));
  float k1 = b - a, k2 = c - a, k3 = e - a, k4 = a - b - c + d, k5 = a - c - e + g, k6 = a - b - e + f;
  float k7 = -a + b + c - d + e - f - g + h;
  return vec4(
    -1.0 + 2.0 * (a + k1 * u.x + k2 * u.y + k3 * u.z + k4 * u.x * u.y + k5 * u.y * u.z + k6 * u.z * u.x + k7 * u.x * u.y * u.z),
    2.0 * du * vec3(k1 + k4 * u.y + k6 * u.z + k7 * u.y * u.z, k2 + k5 * u.z + k4 * u.x + k7 * u.z * u.x, k3 + k6 * u.x + k5 * u.y + k7 * u.x * u.y));
}
`;

export class SkinMaterial extends MeshPhysicalMaterial {
  private readonly own: Record<string, IUniform> = {
    uRidge: { value: new Color() },
    uFurrow: { value: new Color() },
    uBloom: { value: new Color() },
    uBloomAmount: { value: 0 },
    uScale: { value: 0.05 },
    uPores: { value: 0.045 },
  };

  private coat = 0;
  private isPlain = false;

  constructor() {
    super({ metalness: 0, clearcoatRoughness: 0.4, specularIntensity: 0.7, ior: 1.42 });
    this.onBeforeCompile = (shader) => {
      Object.assign(shader.uniforms, this.own);
      shader.vertexShader = shader.vertexShader
        .replace("#include <common>", "#include <common>\nattribute float relief;\nattribute vec3 rest;\nvarying float vRelief;\nvarying vec3 vRest;")
        .replace("#include <begin_vertex>", "#include <begin_vertex>\nvRelief = relief;\nvRest = rest;");
      shader.fragmentShader = shader.fragmentShader
        .replace("#include <common>", `#include <common>\n${NOISE}`)
        .replace(
          "#include <color_fragment>",
          `#include <color_fragment>
          float ridge = smoothstep(-1.1, 0.8, vRelief / uScale);
          float open = smoothstep(-2.2, 0.15, vRelief / uScale);
          #ifdef PLAIN
            vec4 mottle = vec4(0.0), fine = vec4(0.0);
          #else
            vec4 mottle = noised(vRest * 5.0 + 3.0), fine = noised(vRest * 23.0);
          #endif
          diffuseColor.rgb = mix(uFurrow, uRidge, ridge) * (1.0 + 0.13 * mottle.x + 0.07 * fine.x);
          float dust = uBloomAmount * smoothstep(-0.3, 0.9, ridge + 0.35 * mottle.x + 0.25 * fine.x);
          diffuseColor.rgb = mix(diffuseColor.rgb, uBloom, 0.3 * dust);`,
        )
        .replace(
          "#include <roughnessmap_fragment>",
          "#include <roughnessmap_fragment>\nroughnessFactor = clamp(roughnessFactor + 0.2 * (1.0 - ridge) + 0.45 * dust + 0.06 * fine.x, 0.05, 1.0);",
        )
        .replace(
          "#include <normal_fragment_maps>",
          `#include <normal_fragment_maps>
          #ifndef PLAIN
          {
            // pores fade out with the distance, before they are smaller than a pixel (by derivatives, triangles would show)
            vec3 pore = noised(vRest * 38.0).yzw + 0.6 * noised(vRest * 83.0).yzw;
            float fade = 1.0 - smoothstep(5.0, 13.0, vViewPosition.z);
            vec3 slope = mat3(viewMatrix) * pore;
            normal = normalize(normal - fade * uPores * (slope - dot(slope, normal) * normal));
          }
          #endif`,
        )
        .replace(
          "#include <aomap_fragment>",
          `float shade = mix(0.4, 1.0, open);
          reflectedLight.indirectDiffuse *= shade;
          reflectedLight.indirectSpecular *= shade * shade;
          reflectedLight.directSpecular *= mix(0.5, 1.0, open);`,
        );
    };
  }

  /** Without pores, mottles and coat, which cost most where the processor draws. */
  set plain(plain: boolean) {
    if (plain === this.isPlain) return;
    this.isPlain = plain;
    const { PLAIN: _, ...others } = this.defines ?? {};
    this.defines = plain ? { ...others, PLAIN: "" } : others;
    this.clearcoat = plain ? 0 : this.coat;
    this.needsUpdate = true;
  }

  /** Take on a skin at a dryness of 0 to 1; `scale` [r1] is the relief at which ridge and furrow part. */
  wear(skin: Skin, dryness: number, scale: number): void {
    const mix = (into: IUniform, [fresh, dry]: [string, string]): void => {
      into.value.set(fresh).lerp(new Color(dry), dryness);
    };
    mix(this.own.uRidge, skin.ridge);
    mix(this.own.uFurrow, skin.furrow);
    this.own.uBloom.value.set(skin.bloom);
    this.own.uBloomAmount.value = skin.bloom_amount;
    this.own.uScale.value = scale;
    this.roughness = skin.roughness[0] + (skin.roughness[1] - skin.roughness[0]) * dryness;
    this.coat = skin.coat * (1 - 0.5 * dryness);
    this.clearcoat = this.isPlain ? 0 : this.coat;
  }
}
