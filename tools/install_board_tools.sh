#!/usr/bin/env bash
# Installs what the board's checks use beyond Python: KiCad 9 and its libraries (Debian's backports), ngspice, pdftoppm.
#
# Ends with 0 where nothing could be installed: the checks then skip, and say so. Needs root and apt.
set -u
if ! command -v apt-get >/dev/null || [ "$(id -u)" != 0 ]; then
    echo "board tools: no apt or not root; the checks with KiCad and ngspice will be skipped"
    exit 0
fi
export DEBIAN_FRONTEND=noninteractive
start=$SECONDS
# Waits for another package run to end; says apt's own last words where it fails.
quietly() {
    local words
    words=$(timeout 900 apt-get -o DPkg::Lock::Timeout=300 -qq "$@" 2>&1 </dev/null) && return
    printf 'board tools: apt-get %s:\n%s\n' "$1" "$(printf '%s\n' "$words" | tail -n 4)" >&2
    return 1
}
install() { quietly install -y --no-install-recommends "$@"; }

# Next to the Debian source that the machine has already: the same mirror, the suite of the backports.
suite=$(. /etc/os-release && echo "${VERSION_CODENAME:-}")
list=/etc/apt/sources.list.d/board-backports.sources
if ! command -v kicad-cli >/dev/null; then
    deb822=/etc/apt/sources.list.d/debian.sources
    if [ -n "$suite" ] && ! apt-cache policy 2>/dev/null | grep -q "$suite-backports"; then
        if [ -f "$deb822" ]; then
            awk -v suite="$suite-backports" 'BEGIN { RS = ""; FS = "\n" }
                 !done && /(^|\n)Suites:/ { gsub(/(^|\n)#[^\n]*/, ""); gsub(/Suites:[^\n]*/, "Suites: " suite); print; done = 1 }' \
                "$deb822" >"$list"
        else
            grep -hE "^deb .* $suite main" /etc/apt/sources.list 2>/dev/null | head -n 1 |
                sed "s/ $suite / $suite-backports /" >"${list%.sources}.list"
        fi
    fi
    quietly update
    if ! install -t "$suite-backports" kicad; then
        rm -f "$list" "${list%.sources}.list"
        quietly update
        echo "board tools: KiCad 9 could not be installed from $suite-backports; its checks will be skipped"
    fi
fi
if command -v kicad-cli >/dev/null && [ ! -d /usr/share/kicad/symbols ]; then
    install -t "$suite-backports" kicad-symbols kicad-footprints ||
        echo "board tools: KiCad's libraries could not be installed; pins and pads are not compared with them"
fi
command -v ngspice >/dev/null || install ngspice || echo "board tools: ngspice could not be installed; its checks will be skipped"
command -v pdftoppm >/dev/null || install poppler-utils || echo "board tools: pdftoppm could not be installed; no pages are drawn"
echo "board tools: $(kicad-cli version 2>/dev/null || echo 'no KiCad'), $(ngspice --version 2>/dev/null | grep -o 'ngspice-[0-9]*' | head -n 1), after $((SECONDS - start)) s"
