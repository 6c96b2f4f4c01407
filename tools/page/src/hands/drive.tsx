// The part of the hands that drives: the switch, the stick, and what the keys are.
import { useEffect, useRef } from "preact/hooks";
import type { App } from "../shell/app";
import type { Driving } from "./driving";
import { STOP_KEYS } from "./keys";

export function Drive({ app, driving }: { app: App; driving: Driving }) {
  const offer = app.store.handsOffer!, [ahead, left] = driving.way.value, share = driving.share.value, isOn = driving.isOn.value;
  const box = useRef<HTMLDivElement>(null);
  useEffect(() => driving.begin(), [driving]);
  const push = (event: PointerEvent) => {
    const { left: x, top: y, width, height } = box.current!.getBoundingClientRect();
    const reach = (value: number) => Math.max(-1, Math.min(1, value));
    driving.push(reach(1 - (2 * (event.clientY - y)) / height), reach(1 - (2 * (event.clientX - x)) / width));
  };
  const isPushed = useRef(false);
  const release = () => {
    isPushed.current = false;
    driving.push(0, 0);
  };
  return (
    <section class="hand-part" aria-label="Drive">
      <div class="one-line">
        <h2 class="grow">Drive</h2>
        <button type="button" class="switch" aria-pressed={isOn} onClick={() => {
          driving.turnOn(!isOn);
          if (!isOn) box.current?.focus();
        }}>{isOn ? (offer.is_real ? "Stop driving" : "Let go of the wheels") : "Drive by hand"}</button>
      </div>
      <div class="drive-place">
        <div ref={box} class={isOn ? "stick on" : "stick"} tabIndex={0} role="application" aria-label={`Stick and keys: ${isOn ? "drag it, or hold arrows or w a s d" : "switched off"}`} aria-disabled={!isOn}
          onKeyDown={(event) => { if (isOn && !event.ctrlKey && !event.metaKey && !event.altKey && driving.key(event.key, true)) stay(event); }}
          onKeyUp={(event) => { if (isOn && !STOP_KEYS.includes(event.key) && driving.key(event.key, false)) stay(event); }}
          onBlur={() => driving.stop()}
          onPointerDown={(event) => {
            if (!isOn) return;
            box.current!.setPointerCapture(event.pointerId);
            isPushed.current = true;
            push(event);
          }}
          onPointerMove={(event) => { if (isPushed.current) push(event); }}
          onPointerUp={release} onPointerCancel={release} onLostPointerCapture={release}>
          <span class="knob" style={{ left: `${50 - 38 * left}%`, top: `${50 - 38 * ahead}%` }} />
        </div>
        <div class="drive-says">
          <output aria-live="off">{`${(ahead * share * offer.most_mps).toFixed(2)} m/s, ${(left * share * offer.most_dps).toFixed(0)} °/s`}</output>
          <label class="inline-label">most <input type="range" aria-label="Share of the greatest speed" min="0.05" max="1" step="0.05" value={share} onInput={(event) => { driving.share.value = Number(event.currentTarget.value); }} />{`${Math.round(share * 100)} %`}</label>
          <p class="faint">{isOn ? "Hold arrows, w a s d or u o m . here; space stops, + − change the speed. It stands when the page loses focus." : `up to ${offer.most_mps} m/s and ${offer.most_dps} °/s`}</p>
          <p class="faint">{driving.hasPad.value ? "A pad is there: Up takes the wheels, R2 drives ahead, L2 back, the right stick turns, Down lets go." : "A pad is looked for: press one of its buttons."}</p>
        </div>
      </div>
    </section>
  );
}

function stay(event: Event): void {
  event.preventDefault();
  event.stopPropagation();
}
