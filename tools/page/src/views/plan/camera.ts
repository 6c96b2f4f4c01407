// What of the world the plan shows, and how large: pixels of the sheet to metres and back. y goes up in the world.

export interface Bounds {
  readonly x0: number;
  readonly y0: number;
  readonly x1: number;
  readonly y1: number;
}

export class Camera {
  /** Metres, in the middle of the sheet. */
  x = 0;
  y = 0;
  /** Pixels a metre. */
  scale = 100;
  /** Whether it still shows all, so that a changed sheet shows all again. */
  isWhole = true;
  private width = 1;
  private height = 1;

  /** Takes the sheet's size; `edge` are pixels left free around. */
  fit(bounds: Bounds, width: number, height: number, edge: number): void {
    this.width = width;
    this.height = height;
    if (!this.isWhole) return;
    this.x = (bounds.x0 + bounds.x1) / 2;
    this.y = (bounds.y0 + bounds.y1) / 2;
    this.scale = Math.max(1e-3, Math.min((width - 2 * edge) / Math.max(1e-6, bounds.x1 - bounds.x0), (height - 2 * edge) / Math.max(1e-6, bounds.y1 - bounds.y0)));
  }

  px(x: number): number {
    return this.width / 2 + (x - this.x) * this.scale;
  }

  py(y: number): number {
    return this.height / 2 - (y - this.y) * this.scale;
  }

  wx(px: number): number {
    return this.x + (px - this.width / 2) / this.scale;
  }

  wy(py: number): number {
    return this.y - (py - this.height / 2) / this.scale;
  }

  /** Zooms so that what lies under a pixel stays there. */
  zoom(factor: number, px = this.width / 2, py = this.height / 2): void {
    const x = this.wx(px), y = this.wy(py);
    this.isWhole = false;
    this.scale = Math.min(20000, Math.max(0.5, this.scale * factor));
    this.x = x - (px - this.width / 2) / this.scale;
    this.y = y + (py - this.height / 2) / this.scale;
  }

  move(dx: number, dy: number): void {
    this.isWhole = false;
    this.x -= dx / this.scale;
    this.y += dy / this.scale;
  }

  lookAt(x: number, y: number): void {
    this.x = x;
    this.y = y;
  }
}
