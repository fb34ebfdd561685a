// Asking the service, and how it says no. The token stays in this page's memory.

/** One wrong value, in the service's words. */
export interface Culprit {
  name: string;
  detail: string;
  advice: string;
}

/** An error of the service in its own words (RFC 9457). */
export class Problem extends Error {
  constructor(
    readonly detail: string,
    readonly advice: string,
    /** The last part of its type, and the status; of the service's own problems alone. */
    readonly kind: string,
    readonly status = 0,
    readonly errors: Culprit[] = [],
  ) {
    super(`${detail} ${advice}`.trim());
  }
}

let secret = "";

export const token = {
  get known(): boolean {
    return secret !== "";
  },
  /** For a WebSocket, whose opening carries no headers. */
  get secret(): string {
    return secret;
  },
  set(text: string): void {
    secret = text.trim();
  },
};

/** What a request needs to be allowed to run something. */
export const allowed = (more: RequestInit = {}): RequestInit => ({
  ...more,
  headers: { ...(secret ? { Authorization: `Bearer ${secret}` } : {}), ...more.headers },
  cache: "no-store",
});

export async function get(path: string, options: RequestInit = {}): Promise<Response> {
  let response: Response;
  try {
    response = await fetch(path, options);
  } catch (error) {
    if (error instanceof DOMException && error.name === "AbortError") throw error;
    throw new Problem("The service does not answer.", "Start it with `wizen serve`; this page tries again by itself.", "");
  }
  if (response.ok) return response;
  const body = await response.json().catch(() => ({}));
  if (response.status === 401) secret = ""; // asked for again
  const kind = String(body.type ?? "").replace("urn:wizen:problem:", "");
  const detail = body.detail ?? `The service answered ${response.status}.`;
  throw new Problem(detail, body.advice ?? "", kind, response.status, body.errors ?? []);
}

export const read = async <T>(path: string): Promise<T> => (await get(path)).json();

/** Paths in answers begin at the service's root; the page may lie below one of a proxy. */
export const relative = (path: string): string => path.replace(/^\//, "");

/** The same address for a command line. */
export const absolute = (path: string): string => new URL(relative(path), document.baseURI).href;
