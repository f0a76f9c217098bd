meta:
  id: wrapped_telemetry
  endian: le
seq:
  - id: link_frame
    type: link_frame
types:
  link_frame:
    seq:
      - id: header
        type: header
      - id: payload
        type:
          switch-on: header.control & 0x13
          cases:
            0x03: unnumbered
            0x13: unnumbered
            0x00: numbered
            0x10: numbered
            0x02: numbered
            0x12: numbered
  header:
    seq:
      - id: destination
        type: callsign_raw
      - id: destination_ssid
        type: ssid
      - id: source
        type: callsign_raw
      - id: source_ssid
        type: ssid
      - id: control
        type: u1
  callsign_raw:
    seq:
      - id: callsign_ror
        process: ror(1)
        size: 6
        type: callsign
  callsign:
    seq:
      - id: callsign
        type: str
        encoding: ASCII
        size: 6
  ssid:
    seq:
      - id: mask
        type: u1
    instances:
      value:
        value: (mask & 0x0f) >> 1
  numbered:
    seq:
      - id: pid
        type: u1
      - id: info
        type: beacon
  unnumbered:
    seq:
      - id: pid
        type: u1
      - id: info
        type: beacon
  beacon:
    seq:
      - id: kind
        type: u1
      - id: battery
        type: battery
      - id: body
        type:
          switch-on: kind
          cases:
            1: temperatures
            2: orbit
  battery:
    seq:
      - id: voltage
        type: u2
      - id: current
        type: s2
  temperatures:
    seq:
      - id: panels
        type: s1
        repeat: expr
        repeat-expr: 4
  orbit:
    seq:
      - id: place
        type: place
  place:
    seq:
      - id: latitude
        type: s4
      - id: longitude
        type: s4
