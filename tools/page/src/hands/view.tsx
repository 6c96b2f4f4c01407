// The hands: what a person does to a run that goes on.
import "../style/hands.css";
import { render } from "preact";
import type { App, ViewKind } from "../shell/app";
import { Drive } from "./drive";
import { Driving } from "./driving";
import { Board, Done, Faults, Things } from "./parts";

export const hands: ViewKind = {
  id: "hands", title: "Hands", doc: "Drive the robot, move and make things, press, type, turn voltages, put faults: each with its time, to be run again.",
  has: ({ header, mayControl }) => header.value.hands !== null && mayControl.value && !(header.value.hands.is_real && header.value.hands.most_mps === 0), // STOP alone stands in the bar
  mount: (app, host) => {
    render(<Hands app={app} driving={new Driving(app)} />, host);
    return () => render(null, host);
  },
};

function Hands({ app, driving }: { app: App; driving: Driving }) {
  const offer = app.store.handsOffer!, all = app.store.header.value.robot_hands;
  return (
    <div class="hands" tabIndex={0} role="region" aria-label="What hands can do" key={offer.robot}>
      {all.length > 1 && <label class="inline-label">hands on <select aria-label="Robot that hands are on" value={offer.robot} onChange={(event) => { app.store.robot.value = event.currentTarget.value; }}>
        {all.map(({ robot }) => <option value={robot}>{robot}</option>)}
      </select></label>}
      {offer.most_mps > 0 && <Drive app={app} driving={driving} />}
      {offer.is_real ? <button type="button" class="stop" onClick={() => app.stop()}>STOP</button> : <>{app.store.header.value.world && <Things app={app} />}<Faults app={app} /><Board app={app} /><Done app={app} /></>}
    </div>
  );
}
