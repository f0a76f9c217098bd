meta:
  id: can_frame
  title: Serial line CAN
  endian: be
doc: |
  Frames of an adapter.
doc-ref: https://example.com/can
seq:
  - id: sync
    type: u1
    valid: 0xc0
  - id: id
    type: u2
    enum: message
  - id: dlc
    type: u1
  - id: data
    size: dlc
    type:
      switch-on: id
      cases:
        message::engine: engine_data
        message::door: door_data
  - id: crc8
    type: u1
types:
  engine_data:
    seq:
      - id: rpm
        type: u2
      - id: temperature
        type: s1
  door_data:
    seq:
      - id: left_open
        type: b1
      - id: right_open
        type: b1
      - id: reserved
        type: b6
enums:
  message:
    0x101: engine
    0x102: door
