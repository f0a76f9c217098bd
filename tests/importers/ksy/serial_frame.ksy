meta:
  id: serial_frame
  endian: be
seq:
  - id: start
    contents: [0x02]
  - id: header
    type: header
  - id: payload
    size: header.length - 2
    type:
      switch-on: header.command
      cases:
        0x10: set_speed
        0x11: get_state
  - id: checksum
    type: u2
  - id: stop
    contents: "\x03"
types:
  header:
    seq:
      - id: length
        type: u1
        doc: Two more than the payload
      - id: sequence_no
        type: u1
      - id: command
        type: u1
  set_speed:
    doc: Sets the speed.
    seq:
      - id: speed
        type: u2le
  get_state:
    doc: Asks for the state.
    seq: []
