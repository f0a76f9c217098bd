meta:
  id: sized_parts
  endian: be
seq:
  - id: header
    type: header
  - id: pdu
    type: pdu
    size: header.length - 1
  - id: footer
    type: footer
types:
  header:
    seq:
      - id: magic
        contents: [0xa5]
      - id: transaction
        type: b12
      - id: priority
        type: b4
      - id: serial
        size: 4
      - id: length
        type: u2
      - id: unit
        type: u1
  pdu:
    seq:
      - id: function
        type: u1
        enum: function
      - id: data
        type:
          switch-on: function
          cases:
            'function::read': read
            'function::report': report
            'function::name': name
  footer:
    seq:
      - id: checksum
        type: u1
      - id: magic
        contents: [0x15]
  read:
    seq:
      - id: reserved
        type: u2
      - id: quantity
        type: u2
        valid:
          any-of: [1, 2, 3]
  report:
    seq:
      - id: number
        type: u1
      - id: length
        type: u1
      - id: entries
        type: entries
        size: length - 2
      - id: level
        type: u2
        if: number == 3 or number == 5
      - id: state
        type:
          switch-on: number
          cases:
            1: u2
            2: level
  entries:
    seq:
      - id: count
        type: u1
      - id: list
        type: level
        size: 3
        repeat: expr
        repeat-expr: count
  level:
    seq:
      - id: low
        type: u1
      - id: high
        type: u2
  name:
    seq:
      - id: kind
        type: u1
      - id: text
        size: _io.size - 1
enums:
  function:
    3: read
    4: report
    5: name
