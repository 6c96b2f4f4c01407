// The other parts of the hands: things, faults and buttons, the board, and what was done so far.
import { useState } from "preact/hooks";
import type { FaultOffer, WordOffer } from "../generated/view";
import type { App } from "../shell/app";
import { moment } from "../time/format";
import { thingsAt } from "../views/plan/things";
import { freeName, moved, placedBox, placedCylinder, ROBOT } from "./words";

const hand = (app: App, words: string) => app.byHand({ do: "hand", words });

function Numbers({ label, value, step = 0.1, least, most, onValue }: { label: string; value: number; step?: number; least?: number; most?: number; onValue: (value: number) => void }) {
  return <label class="inline-label">{label} <input class="short-input" type="number" step={step} min={least} max={most} value={value} onChange={(event) => onValue(Number(event.currentTarget.value))} /></label>;
}

export function Things({ app }: { app: App }) {
  const present = thingsAt(app.store, app.clock.now.value).filter((thing) => thing.kind !== "robot"), names = present.map((thing) => thing.name);
  const [chosen, setChosen] = useState(ROBOT), [x, setX] = useState(0), [y, setY] = useState(0), [turn, setTurn] = useState(0);
  const [shape, setShape] = useState<"box" | "cylinder">("box"), [length, setLength] = useState(0.4), [width, setWidth] = useState(0.3);
  const name = names.includes(chosen) ? chosen : ROBOT, put = { x, y, heading: (turn * Math.PI) / 180 };
  return (
    <section class="hand-part" aria-label="Robot and things">
      <h2>Robot and things</h2>
      <p class="faint">Or by a drag in the plan, which says above what a drag does: move, draw a box, draw a wall.</p>
      <div class="one-line">
        <select aria-label="What is put elsewhere" value={name} onChange={(event) => setChosen(event.currentTarget.value)}>
          <option value={ROBOT}>robot</option>{names.map((one) => <option value={one}>{one}</option>)}
        </select>
        <Numbers label="x, m" value={x} onValue={setX} /><Numbers label="y, m" value={y} onValue={setY} /><Numbers label="heading, °" step={15} value={turn} onValue={setTurn} />
        <button type="button" onClick={() => hand(app, moved(name, put))}>Put there</button>
        <button type="button" disabled={name === ROBOT} onClick={() => hand(app, `remove ${name}`)}>Take away</button>
      </div>
      <div class="one-line">
        <select aria-label="Shape of a new thing" value={shape} onChange={(event) => setShape(event.currentTarget.value as "box" | "cylinder")}><option value="box">new box</option><option value="cylinder">new cylinder</option></select>
        {shape === "box" && <Numbers label="length, m" least={0.01} value={length} onValue={setLength} />}
        <Numbers label={shape === "box" ? "width, m" : "radius, m"} least={0.01} value={width} onValue={setWidth} />
        <button type="button" onClick={() => {
          const fresh = freeName(shape, [...names, ...(app.store.header.peek().world?.things.map((thing) => thing.name) ?? [])]);
          hand(app, shape === "box" ? placedBox(fresh, length, width, put) : placedCylinder(fresh, width, put));
        }}>Place it there</button>
      </div>
    </section>
  );
}

export function Faults({ app }: { app: App }) {
  const { faults, buttons } = app.store.handsOffer!, [name, setName] = useState(faults[0]?.name ?? ""), [said, setSaid] = useState<Record<string, string>>({}), [button, setButton] = useState(buttons[0] ?? "");
  const fault = faults.find((one) => one.name === name) ?? faults[0];
  const words = fault ? [fault.name, ...fault.words.map((word) => said[word.name] ?? word.usual)].join(" ") : "";
  if (!fault && !buttons.length) return null;
  return (
    <section class="hand-part" aria-label="Faults and buttons">
      <h2>Faults and buttons</h2>
      {fault && <div class="one-line">
        <select aria-label="Fault" value={fault.name} onChange={(event) => setName(event.currentTarget.value)}>{faults.map((one) => <option value={one.name}>{one.name}</option>)}</select>
        {fault.words.map((word) => <Word key={word.name} word={word} value={said[word.name] ?? word.usual} onValue={(value) => setSaid({ ...said, [word.name]: value })} />)}
        <button type="button" onClick={() => hand(app, `fault ${words}`)}>Inject</button>
        {!fault.is_momentary && <button type="button" onClick={() => hand(app, `clear ${cleared(fault, words)}`)}>Clear</button>}
      </div>}
      {fault && <p class="faint">{fault.doc}</p>}
      {buttons.length > 0 && <div class="one-line">
        <select aria-label="Button of the robot" value={button} onChange={(event) => setButton(event.currentTarget.value)}>{buttons.map((one) => <option value={one}>{one}</option>)}</select>
        <button type="button" onClick={() => hand(app, `press ${button}`)}>Press</button><button type="button" onClick={() => hand(app, `clear ${button}`)}>Release</button>
      </div>}
    </section>
  );
}

/** The words that clear a fault: link-down has none behind it. */
function cleared(fault: FaultOffer, words: string): string {
  return fault.words.length ? words : fault.name;
}

function Word({ word, value, onValue }: { word: WordOffer; value: string; onValue: (value: string) => void }) {
  if (word.choices.length) {
    return <select aria-label={word.name} value={value} onChange={(event) => onValue(event.currentTarget.value)}>{word.choices.map((one) => <option value={one}>{one}</option>)}</select>;
  }
  return <label class="inline-label">{word.name} <input class="short-input" type="number" min={word.least} max={word.most} step={word.step || "any"} value={value} onChange={(event) => onValue(event.currentTarget.value)} /></label>;
}

export function Board({ app }: { app: App }) {
  const { pins, analog_pins, ports } = app.store.handsOffer!, [pin, setPin] = useState(pins[0] ?? ""), [analog, setAnalog] = useState(analog_pins[0] ?? "");
  const [volts, setVolts] = useState(1.65), [port, setPort] = useState(ports[0] ?? ""), [text, setText] = useState("");
  return (
    <section class="hand-part" aria-label="Board">
      <h2>Board</h2>
      {pins.length > 0 && <div class="one-line">
        <select aria-label="Wire" value={pin} onChange={(event) => setPin(event.currentTarget.value)}>{pins.map((one) => <option value={one}>{one}</option>)}</select>
        <button type="button" onClick={() => hand(app, `pin ${pin} high`)}>High</button><button type="button" onClick={() => hand(app, `pin ${pin} low`)}>Low</button><button type="button" onClick={() => hand(app, `let go ${pin}`)}>Let go</button>
      </div>}
      {analog_pins.length > 0 && <div class="one-line">
        <select aria-label="Analog pin" value={analog} onChange={(event) => setAnalog(event.currentTarget.value)}>{analog_pins.map((one) => <option value={one}>{one}</option>)}</select>
        <input type="range" aria-label="Volts on it" min="0" max="3.3" step="0.01" value={volts} onInput={(event) => setVolts(Number(event.currentTarget.value))} onChange={(event) => hand(app, `volts ${analog} ${Number(event.currentTarget.value)}`)} />
        <output aria-live="off">{`${volts.toFixed(2)} V`}</output>
        <button type="button" onClick={() => hand(app, `let go ${analog}`)}>Let go</button>
      </div>}
      {ports.length > 0 && <form class="one-line" onSubmit={(event) => {
        event.preventDefault();
        hand(app, `type ${port} ${text}`);
        setText("");
      }}>
        <select aria-label="Console" value={port} onChange={(event) => setPort(event.currentTarget.value)}>{ports.map((one) => <option value={one}>{one}</option>)}</select>
        <input class="grow short-input" aria-label="Line to type into it" maxLength={300} value={text} onInput={(event) => setText(event.currentTarget.value)} />
        <button type="submit">Type</button>
      </form>}
    </section>
  );
}

export function Done({ app }: { app: App }) {
  const run = app.store.run.value!, left = run.hand_count - run.hands.length, isScenario = app.store.header.value.world !== null; // a board by itself is none
  return (
    <section class="hand-part" aria-label="What was done">
      <div class="one-line">
        <h2 class="grow">{`Done by hand: ${run.hand_count}`}</h2>
        {isScenario && <button type="button" disabled={!run.hand_count} onClick={() => app.ask({ do: "save", words: "scenario" })}>Save as scenario</button>}
        {isScenario && <button type="button" disabled={!run.hand_count} onClick={() => app.ask({ do: "save", words: "test" })}>Save as test</button>}
      </div>
      <p class="said saved" role="status">{run.saved}</p>
      {left > 0 && <p class="faint">{`${left} earlier`}</p>}
      {run.hands.length > 0 ? <ol class="plain-list">{run.hands.map((one) => (
        <li><button type="button" class="link" onClick={() => app.clock.seek(one.at_ns)}>{moment(one.at_ns, 1e3)}</button><span class="grow">{one.words}</span></li>
      ))}</ol> : <p class="faint">{isScenario ? "Whatever is done is recorded with its time: the run can be run again with it, without this page." : "Whatever is done is listed with its time, and comes again where the run goes back."}</p>}
    </section>
  );
}
