"""A question to the circuit simulator: circuit, measures, limits, and what the answer cannot show.

Below stand our models of the board's parts, as ngspice subcircuits. Each states where its
figures come from. None comes from a manufacturer, and none knows about temperature,
ageing or spread unless a deck sweeps it.

Invariant: a deck's figures are judged by its limits alone.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Limit:
    """A measured figure and the range that it must lie in."""

    measure: str
    low: float
    high: float
    unit: str
    meaning: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Deck:
    """One simulation."""

    name: str
    title: str
    #: Circuit lines; the analysis line last.
    circuit: str
    #: `meas` lines without the word itself. A measure becomes a vector: none may be named as a node.
    measures: tuple[str, ...]
    limits: tuple[Limit, ...]
    #: Plotted traces: expression and legend.
    traces: tuple[tuple[str, str], ...]
    x_label: str
    y_label: str
    cannot_say: str
    #: Multiplies the sweep's values for the plot's axis.
    x_scale: float = 1.0


def limits(*rows: tuple[str, float, float, str, str]) -> tuple[Limit, ...]:
    """Return limits from rows of measure, lowest, highest, unit and meaning."""
    return tuple(Limit(*row) for row in rows)


#: BC817-40: Gummel-Poon figures in the middle of the data sheet's spread; only on/off levels are asked of it.
BC817 = ".model BC817 NPN(IS=9e-14 BF=320 VAF=52 IKF=0.5 ISE=1e-14 BR=10 RB=1 RE=0.1 RC=0.2 CJE=50p CJC=14p TF=0.6n)"

#: BC807-40: the complement, by the same figures.
BC807 = ".model BC807 PNP(IS=9e-14 BF=320 VAF=52 IKF=0.5 ISE=1e-14 BR=10 RB=1 RE=0.1 RC=0.2 CJE=50p CJC=14p TF=0.6n)"

#: B340A: 0.5 V at 3 A, 40 V reverse, leakage some 10 uA at 25 degrees Celsius (data sheet, memory).
B340A = ".model B340A D(IS=8u N=1.05 RS=0.03 CJO=400p BV=45 IBV=1m)"

#: SMBJ15A: breakdown from 16.7 V, clamps 24.4 V at 24.6 A: 0.3 ohm behind the knee. As a diode: forward like any.
SMBJ15A = ".model SMBJ15A D(IS=1n N=1 RS=0.3 BV=16.7 IBV=1m CJO=1n)"

#: Clamp diode of an input pin: 0.65 V at 2 mA.
CLAMP = ".model CLAMP D(IS=1e-14 N=0.97 RS=10)"

#: Averaged step-down module: a 5 V source that starts within 2 ms, with the output impedance that makes a
#: half-load step dip by the data sheet's 150 mV (0.3 ohm for 250 us); it draws output power / efficiency at its input.
#: memory: start-up time. It holds off below 6.5 V.
BUCK = """
.subckt BUCK in gnd out
Bramp gnd ramp I = V(in,gnd) > 6.5 ? 1u : 0
Cramp ramp gnd 2n
Rramp ramp gnd 100meg
Bup up gnd V = 5*min(1, max(0, V(ramp,gnd)))
Vsense up drive 0
Rfast drive hold 5m
Rslow hold out 0.3
Lslow hold out 30u
Bin in gnd I = V(out,gnd)*max(0, I(Vsense))/0.9/max(1, V(in,gnd)) + 1m
.ends
"""

#: LM317: 1.25 V between OUT and ADJ, 50 uA out of ADJ, 2 V dropout, current limit 1.5 A, 3.5 mA (typical) that must
#: leave through OUT, output impedance 20 mohm rising with 0.2 uH (TI's curve, memory). It can only source.
LM317 = """
.subckt LM317 in adj out
Iadj in adj 50u
Bref want 0 V = min(V(adj) + 1.25, max(0, V(in) - 2.0))
Rlag want lag 1k
Clag lag 0 2n
Ebuf buf 0 lag 0 1
Dsource buf src IDEAL
Rout src mid 20m
Lout mid sense 0.2u
Rdamp mid sense 0.5
Vsense sense out 0
* the load's current enters at IN; so does what the chip consumes, which leaves at OUT
Fin in 0 Vsense 1
Bbias in out I = 3.5m*min(1, max(0, (V(in)-V(out)-0.5)/1.5))
.model IDEAL D(N=0.01 IS=1e-9)
.ends
"""

#: MBRA210L: 0.28 V at 0.6 A, 10 V reverse (data sheet, memory).
MBRA210L = ".model MBRA210L D(IS=40u N=1.05 RS=0.03 CJO=400p BV=12 IBV=1m)"

#: A light: 1.8 V at 1 mA.
LED = ".model LED D(IS=1e-19 N=1.9 RS=5)"

#: MAX3232: averaged charge pump. Doubler and inverter each behind 1/(f C) + switches; regulated at 5.5 V. With
#: f = 200 kHz (memory) and 100 nF: 50 ohm + 4 x 15 ohm of switches. Drivers: 300 ohm / 10 in series (sheet: swing
#: 5.4 V typical into 3 kohm). Receivers: 5 kohm at the line, threshold 1.5 V, 50 ohm at the output. Pins 1 to 16.
MAX3232 = """
.subckt MAX3232 c1p vp c1m c2p c2m vm dout2 rin2 rout2 din2 din1 rout1 rin1 dout1 gnd vcc cpump=100n
.param rp = {1/(200k*cpump) + 60}
Bp 0 vp I = max(0, min((2*V(vcc)-V(vp))/{rp}, 5.5-V(vp)))
Bm vm 0 I = max(0, min((2*V(vcc)+V(vm))/{2*rp}, 5.5+V(vm)))
Bd1 d1 0 V = 0.5*(V(vp)+V(vm)) - 0.5*(V(vp)-V(vm))*tanh(4*(V(din1)-1.4))
Bd2 d2 0 V = 0.5*(V(vp)+V(vm)) - 0.5*(V(vp)-V(vm))*tanh(4*(V(din2)-1.4))
Br1 r1 0 V = 0.5*V(vcc)*(1 - tanh(4*(V(rin1)-1.5)))
Br2 r2 0 V = 0.5*V(vcc)*(1 - tanh(4*(V(rin2)-1.5)))
Rr1 r1 rout1 50
Rr2 r2 rout2 50
Ri1 rin1 0 5k
Ri2 rin2 0 5k
Fp vp 0 Vpos 1
Fm 0 vm Vneg 1
Rd1 d1 dout1 30
Rd2 d2 dout2 30
* what the drivers deliver is taken from the pump
Vpos q1x 0 0
Bq1 0 q1x I = max(0, V(d1)-V(dout1))/30 + max(0, V(d2)-V(dout2))/30
Vneg q2x 0 0
Bq2 0 q2x I = max(0, V(dout1)-V(d1))/30 + max(0, V(dout2)-V(d2))/30
.ends
"""

#: All of them: what `netlist.circuit` refers to.
MODELS = f"{BC817}\n{BC807}\n{B340A}\n{MBRA210L}\n{SMBJ15A}\n{LED}\n{BUCK}\n{LM317}\n{MAX3232}"
