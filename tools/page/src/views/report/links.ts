// Which texts may be links.

/** A file beside the page; what would run a script is no link. */
export function isLink(href: string): boolean {
  if (!href) return false;
  const scheme = /^\s*([a-z][a-z0-9+.-]*):/i.exec(href);
  return !scheme || /^(https?|file)$/i.test(scheme[1]!);
}
