// A sheet that writes what is drawn on it as SVG: what the views call of a canvas, and no more.

interface Drawn { fillStyle: string; strokeStyle: string; globalAlpha: number; font: string; textAlign: CanvasTextAlign; lineWidth: number; lineCap: CanvasLineCap; lineJoin: CanvasLineJoin; dash: readonly number[]; matrix: DOMMatrix; clips: number }

const n = (value: number) => String(Math.round(value * 100) / 100);
const escaped = (text: string) => text.replace(/[&<>"]/g, (sign) => `&#${sign.charCodeAt(0)};`);

export class SvgSheet {
  fillStyle = "#000000"; strokeStyle = "#000000"; globalAlpha = 1; font = "12px sans-serif"; textAlign: CanvasTextAlign = "start"; textBaseline: CanvasTextBaseline = "alphabetic";
  lineWidth = 1; lineCap: CanvasLineCap = "butt"; lineJoin: CanvasLineJoin = "miter";
  private dash: readonly number[] = [];
  private matrix = new DOMMatrix();
  private path = "";
  private readonly parts: string[] = [];
  private readonly stack: Drawn[] = [];
  /** Groups that are cut, which are open. */
  private clips = 0;
  private cuts = 0;

  constructor(private readonly width: number, private readonly height: number, private readonly ground: string, private readonly measure: CanvasRenderingContext2D) {}

  text(): string {
    return `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${n(this.width)} ${n(this.height)}" width="${n(this.width)}" height="${n(this.height)}"><rect width="100%" height="100%" fill="${escaped(this.ground)}"/>${this.parts.join("")}${"</g>".repeat(this.clips)}</svg>\n`;
  }

  save(): void {
    const { fillStyle, strokeStyle, globalAlpha, font, textAlign, lineWidth, lineCap, lineJoin, dash, clips } = this;
    this.stack.push({ fillStyle, strokeStyle, globalAlpha, font, textAlign, lineWidth, lineCap, lineJoin, dash, matrix: DOMMatrix.fromMatrix(this.matrix), clips });
  }

  restore(): void {
    const last = this.stack.pop();
    if (!last) return;
    this.parts.push("</g>".repeat(this.clips - last.clips));
    Object.assign(this, last);
  }

  translate(x: number, y: number): void { this.matrix = this.matrix.translate(x, y); }
  rotate(radians: number): void { this.matrix = this.matrix.rotate((radians * 180) / Math.PI); }
  scale(x: number, y: number): void { this.matrix = this.matrix.scale(x, y); }
  setLineDash(dash: readonly number[]): void { this.dash = dash; }
  measureText(text: string): TextMetrics {
    this.measure.font = this.font;
    return this.measure.measureText(text);
  }

  beginPath(): void { this.path = ""; }
  closePath(): void { this.path += "Z"; }
  moveTo(x: number, y: number): void { this.path += `M${n(x)} ${n(y)}`; }
  lineTo(x: number, y: number): void { this.path += `${this.path ? "L" : "M"}${n(x)} ${n(y)}`; }
  rect(x: number, y: number, width: number, height: number): void { this.path += `M${n(x)} ${n(y)}h${n(width)}v${n(height)}h${n(-width)}Z`; }
  arc(x: number, y: number, radius: number, from: number, to: number, isBack = false): void {
    const turn = 2 * Math.PI, sweep = isBack ? -((((from - to) % turn) + turn) % turn) : to - from >= turn ? turn : (((to - from) % turn) + turn) % turn;
    // Two halves: an arc of SVG is no whole turn.
    for (const [place, at] of [0, sweep / 2, sweep].entries()) {
      const px = x + radius * Math.cos(from + at), py = y + radius * Math.sin(from + at);
      if (place === 0) this.lineTo(px, py);
      else this.path += `A${n(radius)} ${n(radius)} 0 0 ${sweep > 0 ? 1 : 0} ${n(px)} ${n(py)}`;
    }
  }

  fill(): void { this.put(`<path d="${this.path}" ${this.filled()}`); }
  stroke(): void { if (this.path) this.put(`<path d="${this.path}" fill="none" ${this.stroked()}`); }
  fillRect(x: number, y: number, width: number, height: number): void { this.put(`<path d="M${n(x)} ${n(y)}h${n(width)}v${n(height)}h${n(-width)}Z" ${this.filled()}`); }
  strokeRect(x: number, y: number, width: number, height: number): void { this.put(`<path d="M${n(x)} ${n(y)}h${n(width)}v${n(height)}h${n(-width)}Z" fill="none" ${this.stroked()}`); }
  fillText(text: string, x: number, y: number): void { this.write(text, x, y, this.filled()); }
  strokeText(text: string, x: number, y: number): void { this.write(text, x, y, `fill="none" ${this.stroked()}`); }
  clearRect(): void { /* it is clear */ }

  clip(): void {
    const id = `cut-${this.cuts++}`;
    this.parts.push(`<clipPath id="${id}"><path d="${this.path}"${this.moved()}/></clipPath><g clip-path="url(#${id})">`);
    this.clips++;
  }

  private write(text: string, x: number, y: number, style: string): void {
    const anchor = { start: "start", left: "start", center: "middle", right: "end", end: "end" }[this.textAlign];
    this.put(`<text x="${n(x)}" y="${n(y)}" style="font:${escaped(this.font)}" text-anchor="${anchor}" ${style}`, `>${escaped(text)}</text>`);
  }

  private put(begun: string, end = "/>"): void {
    this.parts.push(`${begun}${this.globalAlpha < 1 ? ` opacity="${n(this.globalAlpha)}"` : ""}${this.moved()}${end}`);
  }

  private moved(): string {
    const { a, b, c, d, e, f, isIdentity } = this.matrix;
    return isIdentity ? "" : ` transform="matrix(${[a, b, c, d].map((value) => String(Math.round(value * 1e6) / 1e6)).join(" ")} ${n(e)} ${n(f)})"`;
  }

  private filled(): string { return `fill="${escaped(this.fillStyle)}"`; }
  private stroked(): string {
    return `stroke="${escaped(this.strokeStyle)}" stroke-width="${n(this.lineWidth)}" stroke-linecap="${this.lineCap}" stroke-linejoin="${this.lineJoin}"${this.dash.length ? ` stroke-dasharray="${this.dash.join(" ")}"` : ""}`;
  }
}
