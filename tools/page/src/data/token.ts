// The word that opens the stream: in the fragment of the printed address, which no server is sent; kept for this tab, and taken out of the address.
const KEY = "p2os-token";

export function token(): string {
  const found = new URLSearchParams(location.hash.replace(/^#/, "")), word = found.get("token");
  if (word === null) return sessionStorage.getItem(KEY) ?? "";
  sessionStorage.setItem(KEY, word);
  found.delete("token");
  history.replaceState(null, "", `${location.pathname}${location.search}${found.size ? `#${found}` : ""}`);
  return word;
}
