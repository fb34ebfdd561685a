// Where the table is not enough: the solver relaxes what it gives, or runs exactly what is shown, and hands over the shape.

import { cancel, follow, type Job } from "../service/jobs";
import { Problem } from "../service/http";
import { compute, type Answer, type Asked, type Tier } from "../service/shapes";
import { button, el } from "./dom";
import { needToken } from "./token";

/** Roughness' expected error above which computing is offered in words. */
const LARGE = 0.05;
/** Problems that a run gets around. */
const REFUSALS = ["too-uncertain", "outside-table"];
const WORDS: Record<Tier, string> = { relax: "Relax", run: "Run exactly" };

export class Exact {
  readonly root = el("section", { id: "exact", "aria-label": "Compute it" });
  private readonly buttons: Record<Tier, HTMLButtonElement>;
  private readonly halt = button("Stop", () => void this.cancel());
  private readonly bar = el("progress", { max: "1", value: "0", "aria-label": "Progress of the run" });
  private readonly said = el("span", { role: "status" });
  private job: Job | undefined;

  constructor(
    private readonly now: () => Asked,
    private readonly done: (answer: Answer, asked: Asked) => boolean,
  ) {
    this.buttons = {
      relax: button(WORDS.relax, () => void this.run("relax"), { title: "Let the solver settle the looked-up shape until forces balance: seconds" }),
      run: button(WORDS.run, () => void this.run("run"), { title: "Let the solver compute this very shape from fresh: from seconds to minutes" }),
    };
    this.root.replaceChildren(...Object.values(this.buttons), this.halt, this.bar, this.said);
    this.running(false);
  }

  /** Offer to compute what is not to be trusted. */
  judge(about: Answer["about"]): void {
    const error = about.expected_error?.rgh;
    this.offer(!about.exact && (!about.inside || error === undefined || error >= LARGE), about.exact);
  }

  /** Offer a run where the table refused. */
  refused(error: unknown): void {
    if (error instanceof Problem) this.offer(REFUSALS.includes(error.kind), false);
  }

  private offer(wanted: boolean, exact: boolean): void {
    if (this.job) return;
    for (const one of Object.values(this.buttons)) one.disabled = exact;
    this.say(wanted ? "The table is not sure here: the solver can tell." : exact ? "This is what the solver computed." : "");
  }

  private async run(tier: Tier): Promise<void> {
    if (!(await needToken(WORDS[tier]))) return;
    const asked = this.now();
    this.say("Asking …");
    for (const one of Object.values(this.buttons)) one.disabled = true;
    try {
      let answer = await compute(asked, tier);
      if ("links" in answer) {
        this.job = answer;
        this.running(true);
        const ended = await follow(answer, (job) => this.progress(job));
        if (ended.state !== "done") {
          const { detail, advice } = ended.problem ?? { detail: "The run was stopped.", advice: "" };
          throw new Problem(detail, advice, "");
        }
        answer = (await compute(asked, tier)) as Answer;
      }
      this.end();
      const shown = this.done(answer, asked);
      this.say(shown ? "Computed for this very point." : "The run is done. Go back to where it was asked for, and run again: it is there at once.");
    } catch (error) {
      this.end();
      this.say(error instanceof Problem ? error.message : String(error));
    }
  }

  private progress(job: Job): void {
    this.job = job;
    this.bar.value = job.progress.fraction;
    this.say(job.state === "running" ? `${Math.round(100 * job.progress.fraction)} % ${job.progress.message}` : "Waiting for its turn …");
  }

  private async cancel(): Promise<void> {
    if (!this.job) return;
    try {
      await cancel(this.job);
    } catch (error) {
      this.say(error instanceof Problem ? error.message : String(error));
    }
  }

  private end(): void {
    this.job = undefined;
    for (const one of Object.values(this.buttons)) one.disabled = false;
    this.running(false);
  }

  private running(on: boolean): void {
    for (const one of Object.values(this.buttons)) one.hidden = on;
    this.halt.hidden = this.bar.hidden = !on;
  }

  private say(text: string): void {
    this.said.textContent = text;
  }
}
