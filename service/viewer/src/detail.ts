// How fine to ask: as fine as the connection and the machine keep up with while something moves, finest at rest.

const LEVELS = [48, 64, 96, 128];
const FLUENT = 34; // [ms] for which one answer may take

export class Detail {
  private level = 1;
  finest = 192;

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

  /** The service refused this resolution: ask for less from now on. False if there is no less. */
  refuse(resolution: number): boolean {
    this.finest = Math.floor(resolution / 2);
    return this.finest >= 16;
  }
}
