// Drawn signs: no font is asked for them.
const PATHS = {
  play: "M4 2.5v11l9-5.5z",
  pause: "M4 2.5h3v11H4zM9 2.5h3v11H9z",
  first: "M3 3h2v10H3zM13 3v10L6 8z",
  last: "M11 3h2v10h-2zM3 3v10l7-5z",
  stepBack: "M11.500 3h2v10h-2zM10 3v10L3 8z",
  stepOn: "M2.500 3h2v10h-2zM6 3v10l7-5z",
  halts: "M8 2.500a5.500 5.500 0 1 0 0 11 5.500 5.500 0 0 0 0-11z",
  futures: "M3 2.200a1.800 1.800 0 0 1 .8 3.400v4.800a1.800 1.800 0 1 1-1.600 0V5.600A1.800 1.800 0 0 1 3 2.200zM13 2.200a1.800 1.800 0 0 1 .7 3.500C13.400 8.800 10.500 9.300 5 9.800V8.200c4.900-.4 6.900-.8 7.200-2.500A1.800 1.800 0 0 1 13 2.200z",
  back: "M11 3v10L4 8z",
  forward: "M5 3v10l7-5z",
  closer: "M7 2a5 5 0 1 0 3 9l3.5 3.5 1-1L11 10a5 5 0 0 0-4-8zm0 1.5a3.5 3.5 0 1 1 0 7 3.5 3.5 0 0 1 0-7zM6.3 5h1.4v1.3H9v1.4H7.7V9H6.3V7.7H5V6.3h1.3z",
  further: "M7 2a5 5 0 1 0 3 9l3.5 3.5 1-1L11 10a5 5 0 0 0-4-8zm0 1.5a3.5 3.5 0 1 1 0 7 3.5 3.5 0 0 1 0-7zM5 6.3h4v1.4H5z",
  whole: "M2 2h4.5v1.5h-3v3H2zM9.500 2H14v4.500h-1.500v-3h-3zM2 9.500h1.500v3h3V14H2zM12.500 9.500H14V14H9.500v-1.500h3z",
  follow: "M8 1v2.100A5 5 0 0 1 12.900 8H15v0H12.900A5 5 0 0 1 8 12.900V15 12.900A5 5 0 0 1 3.100 8H1 3.100A5 5 0 0 1 8 3.100zM8 4.600a3.400 3.400 0 1 0 0 6.800 3.400 3.400 0 0 0 0-6.800zM8 6.500a1.500 1.500 0 1 1 0 3 1.500 1.500 0 0 1 0-3z",
  link: "M6.500 4.500l2-2a3.200 3.200 0 0 1 4.500 4.500l-2 2-1-1 2-2a1.800 1.800 0 0 0-2.500-2.500l-2 2zM9.500 11.500l-2 2A3.200 3.200 0 0 1 3 9l2-2 1 1-2 2a1.800 1.800 0 0 0 2.500 2.500l2-2zM5.600 9.400l3.800-3.800 1 1-3.800 3.800z",
  help: "M8 1.500a6.500 6.500 0 1 0 0 13 6.500 6.500 0 0 0 0-13zM8 3a5 5 0 1 1 0 10A5 5 0 0 1 8 3zM7.300 10.500h1.400V12H7.300zM5.600 6.400C5.600 5 6.700 4.200 8 4.200s2.400.8 2.400 2.100c0 1.700-1.700 1.800-1.700 3.300H7.300c0-2 1.700-2.100 1.700-3.200 0-.5-.4-.9-1-.9s-1 .4-1 .9z",
  met: "M6.400 12.500L2.500 8.600l1.200-1.200 2.700 2.700 6-6 1.200 1.200z",
  missed: "M3.700 2.500L8 6.800l4.300-4.300 1.200 1.200L9.200 8l4.300 4.300-1.200 1.200L8 9.200l-4.300 4.300-1.200-1.200L6.800 8 2.500 3.700z",
  open: "M3 7.200h10v1.600H3z",
  unknown: "M8 3a5 5 0 1 0 0 10A5 5 0 0 0 8 3zm0 1.500a3.500 3.500 0 1 1 0 7 3.500 3.500 0 0 1 0-7z",
  close: "M4 3l4 4 4-4 1 1-4 4 4 4-1 1-4-4-4 4-1-1 4-4-4-4z",
} as const;

export type IconName = keyof typeof PATHS;

export function Icon({ name, label }: { name: IconName; label?: string }) {
  return (
    <svg class="icon" viewBox="0 0 16 16" width="16" height="16" {...(label ? { role: "img", "aria-label": label } : { "aria-hidden": "true" })}>
      <path d={PATHS[name]} />
    </svg>
  );
}

/** A button with a drawn sign, and its name for who does not see it. */
export function IconButton(
  { icon, label, pressed, onClick, disabled }: { icon: IconName; label: string; pressed?: boolean; onClick: () => void; disabled?: boolean },
) {
  return (
    <button type="button" class="icon-button" aria-label={label} title={label} onClick={onClick} disabled={disabled ?? false} {...(pressed === undefined ? {} : { "aria-pressed": pressed })}>
      <Icon name={icon} />
    </button>
  );
}
