// Live sessions: one WebSocket onto an engine that runs while somebody works on it (docs/sessions.md).

import { Problem, relative, token } from "./http";

export interface Opened {
  session: string;
  key: string;
  stage: { symbol: string; units: string };
  quality: string;
}

export interface State {
  time: number;
  working: boolean;
  until: number | null;
  undo: number;
  redo: number;
  /** Pairs of triangles that pass through each other; null while the shape is under way. */
  crossings: number | null;
  vertices: number;
}

export interface Saved {
  toml: string;
  command: string;
}

/** The surface as the engine has it; arrays are the client's own and change from frame to frame. */
export interface Surface {
  positions: Float32Array;
  triangles: Uint32Array;
  stage: number;
  residual: number;
  /** Last input that it holds, or, under way, that the equilibrium will hold to which it is on its way. */
  input: number;
  exact: boolean;
  underway: boolean;
  /** Whether its triangles are others than in the frame before. */
  rebuilt: boolean;
}

const MAGIC = "wzn1";
const HEAD = 64;

/** Take a frame into the surface that the one before left. */
export function decode(data: ArrayBuffer, before: Surface | undefined): { number: number; surface: Surface } {
  const head = new DataView(data);
  if (data.byteLength < HEAD || new TextDecoder().decode(new Uint8Array(data, 0, 4)) !== MAGIC) {
    throw new Problem("The service sent a frame that this page cannot read.", "Reload the page.", "");
  }
  const at = (offset: number): number => head.getUint32(offset, true);
  const [number, base, n, m, r, p, q] = [4, 8, 12, 16, 20, 24, 28].map(at);
  const quantum = head.getFloat32(32, true);
  const old = base === 0 ? undefined : before;
  const positions = resized(old?.positions, Float32Array, 3 * n);
  const triangles = resized(old?.triangles, Uint32Array, 3 * m);
  let offset = HEAD;
  const words = (count: number): Uint32Array => {
    offset += 4 * count;
    return new Uint32Array(data, offset - 4 * count, count);
  };
  const newTriangles = r < m ? words(r) : undefined;
  const corners = words(3 * r);
  for (let i = 0; i < r; i++) triangles.set(corners.subarray(3 * i, 3 * i + 3), 3 * (newTriangles ? newTriangles[i] : i));
  const placed = p < n ? words(p) : undefined;
  const places = new Float32Array(data, offset, 3 * p);
  offset += 12 * p;
  for (let i = 0; i < p; i++) positions.set(places.subarray(3 * i, 3 * i + 3), 3 * (placed ? placed[i] : i));
  const moved = q < n ? words(q) : undefined;
  const steps = new Int16Array(data, offset, 3 * q);
  for (let i = 0; i < q; i++) {
    const to = 3 * (moved ? moved[i] : i);
    for (let k = 0; k < 3; k++) positions[to + k] += quantum * steps[3 * i + k];
  }
  const surface = {
    positions,
    triangles,
    stage: head.getFloat64(40, true),
    residual: head.getFloat32(48, true),
    input: at(52),
    exact: (at(60) & 1) !== 0,
    underway: (at(60) & 4) !== 0,
    rebuilt: r > 0 || positions.length !== before?.positions.length || triangles.length !== before?.triangles.length,
  };
  return { number, surface };
}

function resized<T extends Float32Array | Uint32Array>(given: T | undefined, kind: new (length: number) => T, length: number): T {
  if (given?.length === length) return given;
  const made = new kind(length);
  if (given) made.set(given.subarray(0, Math.min(length, given.length)));
  return made;
}

export interface Listener {
  opened(told: Opened): void;
  surface(surface: Surface): void;
  state(state: State): void;
  done(id: number): void;
  saved(saved: Saved): void;
  problem(problem: Problem): void;
  /** The session is over; what was made, where the service says it. */
  over(why: string, toml: string): void;
}

const RETRIES = 3;

export class Session {
  private socket: WebSocket;
  private number = 0;
  private held: Surface | undefined;
  private known: Opened | undefined;
  private ended = false;
  private tries = 0;

  constructor(
    private readonly address: string,
    first: Record<string, unknown>,
    private readonly listener: Listener,
  ) {
    this.socket = this.connect(first);
  }

  /** Send a message; returns its number, by which replies and frames name it. */
  send(what: string, values: Record<string, unknown> = {}): number {
    if (this.socket.readyState !== WebSocket.OPEN) return 0;
    this.socket.send(JSON.stringify({ do: what, id: ++this.number, ...values }));
    return this.number;
  }

  close(): void {
    this.ended = true;
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify({ do: "close", id: ++this.number }));
    this.socket.close();
  }

  private connect(first: Record<string, unknown>): WebSocket {
    const url = new URL(relative(this.address), document.baseURI);
    url.protocol = url.protocol.replace("http", "ws");
    const socket = new WebSocket(url);
    socket.binaryType = "arraybuffer";
    socket.addEventListener("open", () => socket.send(JSON.stringify({ do: "open", id: ++this.number, token: token.secret, ...first })));
    socket.addEventListener("message", ({ data }) => this.hear(data));
    socket.addEventListener("close", (event) => this.left(event));
    return socket;
  }

  private hear(data: string | ArrayBuffer): void {
    if (typeof data === "string") {
      this.told(JSON.parse(data));
      return;
    }
    const { number, surface } = decode(data, this.held);
    this.held = surface;
    this.listener.surface(surface);
    requestAnimationFrame(() => this.socket.readyState === WebSocket.OPEN && this.socket.send(JSON.stringify({ do: "seen", frame: number })));
  }

  private told(message: Record<string, unknown> & { say: string }): void {
    const { listener } = this;
    if (message.say === "opened") {
      this.known = message as unknown as Opened;
      this.tries = 0;
      listener.opened(this.known);
    } else if (message.say === "state") listener.state(message as unknown as State);
    else if (message.say === "done") listener.done(Number(message.id));
    else if (message.say === "saved") listener.saved(message as unknown as Saved);
    else if (message.say === "closing") {
      this.ended = true;
      listener.over(String(message.why), String(message.toml ?? ""));
    } else if (message.say === "error") {
      const { detail, advice, status } = message.problem as { detail: string; advice?: string; status: number };
      if (status === 401) token.set("");
      listener.problem(new Problem(detail, advice ?? "", "", status));
    }
  }

  /** A broken line is mended: the service keeps a session for a while. */
  private left(event: CloseEvent): void {
    const refused = event.code >= 4000 || event.code === 1000;
    if (this.ended || refused || !this.known || this.tries >= RETRIES) {
      if (!this.ended) this.listener.over(event.reason || "The line to the service is broken.", "");
      this.ended = true;
      return;
    }
    const { session, key } = this.known;
    setTimeout(() => (this.socket = this.connect({ session, key })), 500 * 2 ** this.tries++);
  }
}
