// A list of as many rows as there are, of which those that are seen are there; reached by keys, said by screen readers.
import { useEffect, useRef, useState } from "preact/hooks";
import type { ComponentChildren } from "preact";

export const ROW_PX = 24;
/** Rows drawn beyond both ends of what is seen. */
const MARGIN = 8;

interface Props {
  readonly label: string;
  readonly count: number;
  readonly selected: number;
  /** The row of now: brought into sight as it changes, where `follows`. */
  readonly current: number;
  readonly follows: boolean;
  readonly row: (place: number) => ComponentChildren;
  readonly classOf?: (place: number) => string;
  readonly onChoose: (place: number) => void;
}

export function Rows({ label, count, selected, current, follows, row, classOf, onChoose }: Props) {
  const box = useRef<HTMLDivElement>(null), [top, setTop] = useState(0), [high, setHigh] = useState(400), [id] = useState(() => `rows-${Math.random().toString(36).slice(2)}`);
  useEffect(() => {
    const observer = new ResizeObserver(() => setHigh(box.current?.clientHeight ?? 400));
    observer.observe(box.current!);
    return () => observer.disconnect();
  }, []);
  const show = (place: number) => {
    const element = box.current;
    if (!element || place < 0) return;
    if (place * ROW_PX < element.scrollTop) element.scrollTop = place * ROW_PX;
    else if ((place + 1) * ROW_PX > element.scrollTop + element.clientHeight) element.scrollTop = (place + 1) * ROW_PX - element.clientHeight;
  };
  useEffect(() => { if (follows) show(current); }, [current, follows, count]);
  useEffect(() => { if (selected >= 0) show(selected); }, [selected]);
  const first = Math.max(0, Math.floor(top / ROW_PX) - MARGIN), last = Math.min(count, Math.ceil((top + high) / ROW_PX) + MARGIN), shown = [];
  for (let place = first; place < last; place++) shown.push(
    <div key={place} id={`${id}-${place}`} role="option" aria-selected={place === selected} aria-setsize={count} aria-posinset={place + 1}
      class={`row${place === selected ? " selected" : ""}${place === current ? " current" : ""} ${classOf?.(place) ?? ""}`}
      onClick={() => onChoose(place)} ref={(element) => { if (element) element.style.transform = `translateY(${place * ROW_PX}px)`; }}>{row(place)}</div>,
  );
  const page = Math.max(1, Math.floor(high / ROW_PX) - 1);
  const steps: Readonly<Record<string, number>> = { ArrowDown: 1, ArrowUp: -1, PageDown: page, PageUp: -page, Home: -Infinity, End: Infinity };
  return (
    <div class="rows" ref={box} role="listbox" aria-label={label} tabIndex={0} onScroll={(event) => setTop(event.currentTarget.scrollTop)}
      {...(selected >= first && selected < last ? { "aria-activedescendant": `${id}-${selected}` } : {})}
      onKeyDown={(event) => {
        const step = steps[event.key];
        if (step === undefined || !count) return;
        event.preventDefault();
        event.stopPropagation();
        onChoose(Math.min(count - 1, Math.max(0, (selected >= 0 ? selected : current) + step)));
      }}>
      <div class="rows-inner" role="presentation" ref={(element) => { if (element) element.style.height = `${count * ROW_PX}px`; }}>{shown}</div>
    </div>
  );
}
