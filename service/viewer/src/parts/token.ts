// Runs take a token. It is asked for once and stays in this page's memory.

import { token } from "../service/http";
import { button, el } from "./dom";

/** Ask for a token where none is known; false where nobody gave one. */
export function needToken(what: string): Promise<boolean> {
  if (token.known) return Promise.resolve(true);
  return new Promise((resolve) => {
    const secret = el("input", { type: "password", id: "token", autocomplete: "off", required: "" });
    const form = el(
      "form",
      { method: "dialog" },
      el("h2", {}, what),
      el("p", {}, "The solver computes this on the service's machine, which takes from seconds to minutes. For that the service wants a token of the scope run:"),
      el("code", {}, "wizen token create --store DIR --scopes run --name me"),
      el("p", { class: "hint" }, "`wizen serve --studio` opens the page with one."),
      el("label", { for: "token" }, "Token"),
      secret,
      el("div", { class: "row" }, el("button", { type: "submit", class: "primary" }, "Run"), button("Cancel", () => dialog.close())),
    );
    const dialog = el("dialog", { "aria-label": what }, form);
    form.addEventListener("submit", () => token.set(secret.value));
    dialog.addEventListener("close", () => {
      dialog.remove();
      resolve(token.known);
    });
    document.body.append(dialog);
    dialog.showModal();
  });
}
