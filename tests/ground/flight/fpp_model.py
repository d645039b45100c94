"""A rover of 200 commands in FPP: what a flight project has, written down for these tests."""

from __future__ import annotations

COMPONENTS = 10
HEAD = """
type FwSizeStoreType = U16
type FwSizeType = U32
type FwOpcodeType = U32
type FwChanIdType = U32
type FwEventIdType = U32
type FwPacketDescriptorType = U16
type FwTlmPacketizeIdType = U16
type FwDpIdType = U32
type FwDpPriorityType = U32
type FwTimeBaseStoreType = U16
type FwTimeContextStoreType = U8
type FwPrmIdType = U32
constant FW_FIXED_LENGTH_STRING_SIZE = 256
module Fw {
  port Cmd
  port CmdReg
  port CmdResponse
  port Tlm
  port Time
  enum DpState : U8 { UNTRANSMITTED }
  module DpCfg {
    constant CONTAINER_USER_DATA_SIZE = 32
    enum ProcType : U8 { NONE }
  }
}
enum Gain { LOW, HIGH, AUTO }
array Corner = [3] F32
struct Window { width: U16, height: U16 }
"""
PORTS = """
  command recv port cmdIn
  command reg port cmdRegOut
  command resp port cmdResponseOut
  telemetry port tlmOut
  time get port timeGetOut
"""
SPECIAL = {
    ("Mob", 0): "DRIVE_TO(goal: string size 40, fast: bool)",
    ("Eyes", 0): "TRACK(target: string size 40)",
    ("Eyes", 1): "UNTRACK(target: string size 40)",
    ("Spec", 0): "MEASURE(target: string size 40, gain: Gain, exposure_ms: U32, roi: Window)",
    ("Arm", 0): "TOUCH(target: string size 40, force: F32)",
}
NAMES = ("Mob", "Eyes", "Spec", "Arm", "Pwr", "Com", "Nav", "Therm", "Data", "Fault")
FORMS = (
    "SET_{k}(level: U8 @< level to set\n    )",
    "MOVE_{k}(to: Corner, speed: F64)",
    "MODE_{k}(gain: Gain, keep: bool)",
    "LABEL_{k}(label: string size 20)",
    "CLEAR_{k}",
)


def fpp_model() -> str:
    """Return the model: ten components of twenty commands each, and some telemetry."""
    parts = [HEAD]
    for number, name in enumerate(NAMES):
        lines = [f"passive component {name} {{"]
        for k in range(20):
            form = SPECIAL.get((name, k)) or FORMS[k % len(FORMS)].format(k=k)
            lines.append(f"  @ command {k} of {name}\n  sync command {form} opcode {k}")
        lines.append("  telemetry Level: F32 id 0 low { red 1.0, yellow 2.0 } high { red 9.0 }")
        lines.append("  telemetry State: Gain id 1")
        parts += [*lines, PORTS, "}", f"instance {name.lower()}: {name} base id {0x100 * (number + 1)}"]
    instances = "\n".join(f"  instance {name.lower()}" for name in NAMES)
    return "\n".join([*parts, f"deployment topology Top {{\n{instances}\n}}\n"])


MAP = """
format = "flight-map/1"

[default]
time_s = 15.0
energy_j = 150.0

[commands."spec.MEASURE"]
arguments = { gain = "AUTO", exposure_ms = 250, "roi.width" = 64, "roi.height" = 48 }
needs = ["mast"]

[commands."arm.TOUCH"]
arguments = { force = 2.5 }
needs = ["arm"]

[instruments.spectrometer]
use = "remote"
action = "spec.MEASURE"
doc = "spectrometer on the mast"
time_s = { mean = 240.0, sd = 20.0 }
energy_j = { mean = 2600.0, sd = 200.0 }
standoff_m = 2.0

[instruments.toucher]
use = "contact"
action = "arm.TOUCH"
doc = "feels the rock"
time_s = { mean = 400.0, sd = 60.0 }
energy_j = { mean = 9000.0, sd = 900.0 }

[sent.navigate]
command = "mob.DRIVE_TO"
arguments = { goal = "$target", fast = false }

[sent.trackstart]
command = "eyes.TRACK"
arguments = { target = "$target" }

[sent.trackstop]
command = "eyes.UNTRACK"
arguments = { target = "$target" }
"""
