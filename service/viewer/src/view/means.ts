// What the browser draws with, and so how much of the studio it can afford.

/** Names of what draws on the processor, which takes seconds for a frame with soft boxes, shadows and pores. */
const BY_PROCESSOR = /swiftshader|llvmpipe|softpipe|software|basic render/i;
const CHOICE = "wizen-look";

export type Look = "full" | "plain";

/** Whether the browser draws without a graphics card. */
export function drawsByProcessor(): boolean {
  const probe = document.createElement("canvas").getContext("webgl2");
  if (!probe) return false;
  const named = probe.getExtension("WEBGL_debug_renderer_info");
  const name = String(probe.getParameter(named ? named.UNMASKED_RENDERER_WEBGL : probe.RENDERER));
  probe.getExtension("WEBGL_lose_context")?.loseContext();
  return BY_PROCESSOR.test(name);
}

/** The look that was chosen here before, or the one that this browser can draw at the rate of a hand. */
export function preferred(byProcessor: boolean): Look {
  const chosen = kept()?.getItem(CHOICE);
  if (chosen === "full" || chosen === "plain") return chosen;
  return byProcessor ? "plain" : "full";
}

/** Keep a choice for as long as the tab is open. */
export function prefer(look: Look): void {
  kept()?.setItem(CHOICE, look);
}

/** What lasts as long as the tab; nothing where the browser forbids it, in a frame of another page, say. */
function kept(): Storage | undefined {
  try {
    return sessionStorage;
  } catch {
    return undefined;
  }
}
