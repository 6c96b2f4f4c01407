// Goals: how each stands now and at the end, and its margin over time.
import { render } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { type Frame, numbers, texts } from "../../data/frames";
import { lastAt } from "../../data/search";
import type { ChannelHeader } from "../../generated/view";
import type { App, ViewKind } from "../../shell/app";
import { Icon, type IconName } from "../../shell/icons";
import { SMALL_FONT, surface } from "../../shell/surface";
import { theme } from "../../shell/theme";
import { moment, quantity, roundStep, ticks } from "../../time/format";
import { reads } from "../../time/reads";

export const goals: ViewKind = {
  id: "goals", title: "Goals", doc: "The goals of the scenario: how each stands, and by how much.",
  has: (store) => store.channels("goal").length > 0,
  mount: (app, host) => {
    render(<Goals app={app} />, host);
    return () => render(null, host);
  },
};

const STANDINGS: readonly { icon: IconName; words: string; css: string }[] = [
  { icon: "unknown", words: "open", css: "open" }, { icon: "met", words: "met", css: "passed" }, { icon: "missed", words: "missed", css: "failed" }, { icon: "open", words: "not judged", css: "open" },
];

function Goals({ app }: { app: App }) {
  const { store, clock } = app;
  reads(store.version.value);
  return (
    <ul class="goal-list">
      {store.channels("goal").map((channel) => {
        const frame = store.whole(channel.id), row = frame ? lastAt(frame.t, clock.now.value) : -1, final = frame ? frame.count - 1 : -1;
        const standing = (at: number) => STANDINGS[at >= 0 ? numbers(frame!, "standing")[at]! : 0] ?? STANDINGS[0]!;
        const now = standing(row), end = standing(final), says = frame && row >= 0 ? texts(frame, "says").at(row) : "", margin = frame && row >= 0 ? numbers(frame, "margin")[row]! : NaN;
        const judged = frame && judgedAt(frame);
        return (
          <li key={channel.id}>
            <p class="goal"><span class={`standing ${now.css}`}><Icon name={now.icon} label={now.words} /></span>
              <span class="grow">{[channel.source, channel.name].filter(Boolean).join(": ")}</span>
              {Number.isFinite(margin) && <span class="faint">{`margin ${quantity(margin, channel.unit)}`}</span>}</p>
            <p class="faint goal-note">{[says, now !== end ? `at the end: ${end.words}` : "", judged !== undefined ? "" : ""].filter(Boolean).join("; ")}
              {judged !== undefined && end !== STANDINGS[0] && <button type="button" class="link" onClick={() => clock.seek(judged)}>{`${end.words} at ${moment(judged)}`}</button>}</p>
            {frame && hasMargin(frame) && <Margin app={app} channel={channel} />}
          </li>
        );
      })}
    </ul>
  );
}

/** When a goal came to stand as it does at the end. */
function judgedAt(frame: Frame): number | undefined {
  const standings = numbers(frame, "standing");
  let row = frame.count - 1;
  while (row > 0 && standings[row - 1] === standings[row]) row--;
  return row >= 0 ? frame.t[row] : undefined;
}

const hasMargin = (frame: Frame) => numbers(frame, "margin").filter((margin) => Number.isFinite(margin)).length > 2;

function Margin({ app, channel }: { app: App; channel: ChannelHeader }) {
  const place = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const { store, clock } = app;
    const { canvas, dispose } = surface(place.current!, `Margin of ${channel.name} over time`, () => reads(store.version.value, clock.now.value, clock.from.value, clock.to.value), ({ g, width, height }) => {
      const frame = store.rows(channel.id, clock.from.value, clock.to.value, width);
      if (!frame) return;
      const margins = numbers(frame, "margin"), left = 56, from = clock.from.value, span = clock.span.value;
      let least = 0, most = 0;
      for (const margin of margins) if (Number.isFinite(margin)) { least = Math.min(least, margin); most = Math.max(most, margin); }
      if (most === least) most = least + 1;
      const x = (t: number) => left + ((t - from) / span) * (width - left - 6), y = (value: number) => 6 + ((most - value) / (most - least)) * (height - 12), step = roundStep(most - least, 2);
      g.font = SMALL_FONT;
      g.textAlign = "right";
      for (const value of ticks(least, most, step)) {
        g.fillStyle = theme.value.faint;
        g.fillText(quantity(value, channel.unit), left - 5, y(value) + 4);
        g.strokeStyle = value === 0 ? theme.value.bad : theme.value.line;
        g.beginPath(); g.moveTo(left, y(value)); g.lineTo(width - 6, y(value)); g.stroke();
      }
      g.save();
      g.beginPath(); g.rect(left, 0, width - left - 6, height); g.clip();
      g.strokeStyle = theme.value.left; g.lineWidth = 1.4;
      g.beginPath();
      for (let row = Math.max(0, lastAt(frame.t, from)); row < frame.count; row++) if (Number.isFinite(margins[row]!)) g.lineTo(x(frame.t[row]!), y(margins[row]!));
      g.stroke();
      g.strokeStyle = theme.value.ink; g.lineWidth = 1;
      g.beginPath(); g.moveTo(x(clock.now.value), 0); g.lineTo(x(clock.now.value), height); g.stroke();
      g.restore();
    });
    canvas.tabIndex = -1;
    return dispose;
  }, [channel.id]);
  return <div class="margin" ref={place} />;
}
