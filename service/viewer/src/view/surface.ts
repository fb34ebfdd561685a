// The lattice as a triangle mesh: n rows of 2n points, then the two poles. Plain arrays, no three.js.
//
// The mesh is closed as it stands: the last column joins the first, and each pole is one vertex, so no seam can show.
// Azimuth runs from x towards z about y; triangles run along azimuth first, which makes them counter-clockwise from
// outside (service/formats/mesh.py builds the same ones). Their order and the diagonal that cuts each quad are a promise
// of the service's: only with these triangles does `crossings` of an answer hold.

export const vertexCount = (n: number): number => 2 * n * n + 2;

export function triangles(n: number): Uint32Array {
  const m = 2 * n;
  const out = new Uint32Array(12 * n * n);
  let at = 0;
  const add = (a: number, b: number, c: number): void => {
    out[at++] = a;
    out[at++] = b;
    out[at++] = c;
  };
  const north = n * m;
  const south = north + 1;
  for (let j = 0; j < m; j++) {
    const e = (j + 1) % m;
    add(north, e, j);
    add(south, (n - 1) * m + j, (n - 1) * m + e);
    for (let i = 0; i + 1 < n; i++) {
      const a = i * m + j;
      const b = i * m + e;
      add(a, b, a + m);
      add(b, b + m, a + m);
    }
  }
  return out;
}

/** Outward unit normals: of each vertex the mean of its triangles, weighted by area, as in the service's files. */
export function normals(p: Float32Array, corners: ArrayLike<number>, out: Float32Array): void {
  out.fill(0);
  for (let k = 0; k < corners.length; k += 3) {
    const a = 3 * corners[k], b = 3 * corners[k + 1], c = 3 * corners[k + 2];
    const ux = p[b] - p[a], uy = p[b + 1] - p[a + 1], uz = p[b + 2] - p[a + 2];
    const vx = p[c] - p[a], vy = p[c + 1] - p[a + 1], vz = p[c + 2] - p[a + 2];
    const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
    for (const at of [a, b, c]) {
      out[at] += x;
      out[at + 1] += y;
      out[at + 2] += z;
    }
  }
  for (let k = 0; k < out.length; k += 3) {
    const length = Math.hypot(out[k], out[k + 1], out[k + 2]) || 1;
    out[k] /= length;
    out[k + 1] /= length;
    out[k + 2] /= length;
  }
}

/** Height of each vertex over its smoothed surroundings [r1], about -0.1 in a furrow to 0.1 on a ridge. */
export function relief(p: Float32Array, n: number, reach: number, out: Float32Array): void {
  const m = 2 * n;
  const radius = new Float32Array(n * m);
  for (let k = 0; k < radius.length; k++) radius[k] = Math.hypot(p[3 * k], p[3 * k + 1], p[3 * k + 2]);
  let smooth: Float32Array = radius;
  for (let pass = 0; pass < 2; pass++) smooth = blurRows(blurColumns(smooth, n, reach), n, reach);
  for (let k = 0; k < radius.length; k++) out[k] = radius[k] - smooth[k];
  for (const [pole, row] of [[n * m, 0], [n * m + 1, n - 1]]) {
    const height = Math.hypot(p[3 * pole], p[3 * pole + 1], p[3 * pole + 2]);
    let mean = 0;
    for (let j = 0; j < m; j++) mean += smooth[row * m + j] / m;
    out[pole] = height - mean;
  }
}

/** Box means along azimuth, as wide on the sphere [radian] at every latitude. */
function blurColumns(field: Float32Array, n: number, reach: number): Float32Array {
  const m = 2 * n;
  const out = new Float32Array(field.length);
  const sums = new Float64Array(m + 1);
  for (let i = 0; i < n; i++) {
    const half = Math.min(n - 1, Math.round(((reach / 2) * n) / Math.PI / Math.sin(((i + 0.5) * Math.PI) / n)));
    for (let j = 0; j < m; j++) sums[j + 1] = sums[j] + field[i * m + j];
    for (let j = 0; j < m; j++) {
      const a = j - half;
      const b = j + half + 1;
      let sum = sums[Math.min(b, m)] - sums[Math.max(a, 0)];
      if (a < 0) sum += sums[m] - sums[m + a];
      if (b > m) sum += sums[b - m];
      out[i * m + j] = sum / (2 * half + 1);
    }
  }
  return out;
}

/** Box means along meridians, on over the poles. */
function blurRows(field: Float32Array, n: number, reach: number): Float32Array {
  const m = 2 * n;
  const out = new Float32Array(field.length);
  const half = Math.max(1, Math.min(n - 1, Math.round(((reach / 2) * n) / Math.PI)));
  const at = (i: number, j: number): number => {
    if (i < 0) return field[(-1 - i) * m + ((j + n) % m)];
    if (i >= n) return field[(2 * n - 1 - i) * m + ((j + n) % m)];
    return field[i * m + j];
  };
  for (let j = 0; j < m; j++) {
    let sum = 0;
    for (let i = -half; i <= half; i++) sum += at(i, j);
    for (let i = 0; i < n; i++) {
      out[i * m + j] = sum / (2 * half + 1);
      sum += at(i + half + 1, j) - at(i - half, j);
    }
  }
  return out;
}
