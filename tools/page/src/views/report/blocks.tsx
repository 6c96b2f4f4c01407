// The parts of a report: tables, lists, listings, pictures and plots, as the header's sections have them.
import { createContext } from "preact";
import { useContext, useEffect, useRef } from "preact/hooks";
import type { PageBlock, PageCell, PageDrawing, PageList, PagePicture, PageSection, PageSource, PageTable, PageText, Standing } from "../../generated/view";
import { Icon, type IconName } from "../../shell/icons";
import { mountPlan } from "./figure_plan";
import { mountPlot } from "./figure_plot";
import { isLink } from "./links";
import { OpenRun } from "./open_run";
import { moment } from "../../time/format";

/** Goes to a time of the run; absent on a page without one. */
export type Seek = ((t: number) => void) | undefined;

/** The page's time, ns: what had not run by then has not yet. */
export const BY_NOW = createContext(Infinity);

const SIGNS: Readonly<Record<Exclude<Standing, "">, readonly [IconName, string]>> = { passed: ["met", "passed"], failed: ["missed", "failed"], open: ["open", "not judged"] };

export function Sections({ sections, seek }: { sections: readonly PageSection[]; seek: Seek }) {
  return <>{sections.map((section) => <Section key={section.title} section={section} seek={seek} />)}</>;
}

function Section({ section, seek }: { section: PageSection; seek: Seek }) {
  const blocks = section.blocks.map((block, n) => <Block key={n} block={block} seek={seek} />);
  const note = section.note && <small>{section.note}</small>;
  if (section.is_folded) return <details class="section"><summary><h2>{section.title}{note}</h2></summary>{blocks}</details>;
  return <section class="section"><h2>{section.title}{note}</h2>{blocks}</section>;
}

function Block({ block, seek }: { block: PageBlock; seek: Seek }) {
  switch (block.kind) {
    case "table": return <Table block={block} seek={seek} />;
    case "list": return <List block={block} seek={seek} />;
    case "text": return <Text block={block} />;
    case "picture": return <Picture block={block} />;
    case "source": return <Source block={block} seek={seek} />;
    case "drawing": return <Drawing block={block} />;
    case "plot": return <Mounted mount={(host) => mountPlot(host, block)} />;
    case "plan": return <div><Mounted mount={(host) => mountPlan(host, block)} />{block.opens !== null && <OpenRun number={block.opens} title={block.title} />}</div>;
  }
}

function Cell({ cell, seek }: { cell: PageCell; seek: Seek }) {
  const sign = cell.standing ? SIGNS[cell.standing] : undefined;
  const text = isLink(cell.href) ? <a href={cell.href}>{cell.text}</a>
    : cell.at_ns !== null && seek ? <button type="button" class="link" onClick={() => seek(cell.at_ns!)}>{cell.text}</button> : cell.text;
  return <>{sign && <span class={`standing ${cell.standing}`}><Icon name={sign[0]} label={sign[1]} /></span>}{text}</>;
}

function Table({ block, seek }: { block: PageTable; seek: Seek }) {
  return (
    <div class="wide" tabIndex={0} role="group" aria-label={block.title || block.head.join(", ") || "Figures"}>
      <table class={block.head.length ? "data" : "figures"}>
        {block.title && <caption>{block.title}</caption>}
        {block.head.length > 0 && <thead><tr>{block.head.map((name, n) => (name ? <th scope="col" class={block.rows[0]?.[n]?.is_number ? "number" : ""}>{name}</th> : <td />))}</tr></thead>}
        <tbody>{block.rows.map((row) => <tr>{row.map((cell, n) => {
          const kind = cell.is_number || (!block.head.length && n > 0) ? "number" : "";
          return n === 0 && !block.head.length ? <th scope="row"><Cell cell={cell} seek={seek} /></th> : <td class={kind}><Cell cell={cell} seek={seek} /></td>;
        })}</tr>)}</tbody>
      </table>
    </div>
  );
}

function List({ block, seek }: { block: PageList; seek: Seek }) {
  return <>{block.title && <h3>{block.title}</h3>}<ul class="standings">{block.items.map((cell) => <li><Cell cell={cell} seek={seek} /></li>)}</ul></>;
}

function Text({ block }: { block: PageText }) {
  const title = block.title && <h3>{block.title}</h3>;
  return block.is_listing ? <>{title}<pre tabIndex={0} role="group" aria-label={block.title || "Listing"}>{block.text}</pre></> : <>{title}<p class="prose">{block.text}</p></>;
}

/** What a line has come to: a class, and words. */
const RAN = { none: "", ran: "has run", part: "has run, one of its branches always the same way", not: "has not run" } as const;

function Source({ block, seek }: { block: PageSource; seek: Seek }) {
  const now = useContext(BY_NOW), oneWay = new Set(block.one_way);
  const state = (n: number): keyof typeof RAN => {
    const at = block.ran_ns[n] ?? -2;
    if (at === -2) return "none";
    if (at === -1 || at > now) return "not";
    return oneWay.has(block.first + n) ? "part" : "ran";
  };
  return (
    <figure class="source">
      <figcaption>{block.title}</figcaption>
      <div class="lines" tabIndex={0} role="group" aria-label={block.title}><ol>
        {block.lines.map((line, n) => {
          const kind = state(n), number = block.first + n, at = block.ran_ns[n] ?? -2, isNext = number === block.next;
          return (
            <li class={isNext ? `${kind} next` : kind} {...(at > 0 && seek ? { onClick: () => seek(at), title: `${RAN[kind]}; first at ${moment(at, 1e3)}` } : { title: RAN[kind] })}>
              <span class="mark"><span class="unseen">{RAN[kind]}</span></span><span class="number">{isNext ? `→ ${number}` : number}</span><code>{line || " "}</code>
            </li>
          );
        })}
      </ol></div>
    </figure>
  );
}

function Picture({ block }: { block: PagePicture }) {
  return <figure>{/^[A-Za-z0-9+/=\s]*$/.test(block.png) && <img alt={block.alt} src={`data:image/png;base64,${block.png}`} />}{block.title && <figcaption>{block.title}</figcaption>}</figure>;
}

function Drawing({ block }: { block: PageDrawing }) {
  return (
    <figure class="drawing">
      <svg viewBox={`0 0 ${block.width} ${block.height}`} role="img" aria-label={`${block.title}: ${block.alt}`}>
        {block.shapes.map((shape) => {
          const role = `shape ${shape.role}`, title = shape.title && <title>{shape.title}</title>;
          if (shape.kind === "box") return <rect class={role} x={shape.x} y={shape.y} width={shape.width} height={shape.height} rx="4">{title}</rect>;
          if (shape.kind === "circle") return <circle class={role} cx={shape.x} cy={shape.y} r={shape.width}>{title}</circle>;
          return <text class={role} x={shape.x} y={shape.y} text-anchor={shape.align}>{shape.text}</text>;
        })}
      </svg>
    </figure>
  );
}

function Mounted({ mount }: { mount: (host: HTMLElement) => () => void }) {
  const host = useRef<HTMLDivElement>(null);
  useEffect(() => mount(host.current!), []);
  return <div class="mounted" ref={host} />;
}
