// How fine to ask: as fine as the connection and the machine keep up with while something moves, finest at rest.

const LEVELS = [48, 64, 96, 128];
const FINEST = 192;
const FLUENT = 34; // [ms] for which one answer may take

export class Detail {
  private level = 1;
  readonly finest: number;

  /** `most` is what the service computes at most. */
  constructor(most: number) {
    this.finest = Math.min(FINEST, most);
  }

  /** Resolution of the next question. */
  of(moving: boolean): number {
    return Math.min(moving ? LEVELS[this.level] : this.finest, this.finest);
  }

  /** Learn from an answer: coarser at once when it was slow, finer only when there was plenty of time. */
  learn(resolution: number, milliseconds: number): void {
    if (resolution !== LEVELS[this.level]) return;
    if (milliseconds > 2 * FLUENT && this.level > 0) this.level--;
    else if (milliseconds < FLUENT / 3 && this.level + 1 < LEVELS.length) this.level++;
  }
}
