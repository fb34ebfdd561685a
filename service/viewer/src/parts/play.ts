// The stage axis as a film: the stage runs from the first to the last, waits there, and starts again.

const SECONDS = 7;
const REST = 0.14; // share of the time in which it stands still at the end

export class Player {
  private started = 0;
  private handle = 0;

  /** `show` is given shares of the stage's range, 0 to 1. */
  constructor(
    private readonly show: (share: number) => void,
    private readonly switched: (on: boolean) => void,
  ) {}

  get on(): boolean {
    return this.handle !== 0;
  }

  /** Start at a share of the range, or stop. */
  toggle(share: number): void {
    if (this.on) {
      this.stop();
      return;
    }
    const from = share > 0.995 ? 0 : share;
    this.started = performance.now() - from * (1 - REST) * SECONDS * 1000;
    this.handle = requestAnimationFrame((now) => this.frame(now));
    this.switched(true);
  }

  stop(): void {
    if (!this.on) return;
    cancelAnimationFrame(this.handle);
    this.handle = 0;
    this.switched(false);
  }

  private frame(now: number): void {
    const time = ((now - this.started) / 1000 / SECONDS) % 1;
    this.show(Math.min(1, time / (1 - REST)));
    this.handle = requestAnimationFrame((next) => this.frame(next));
  }
}
