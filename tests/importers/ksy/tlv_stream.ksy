meta:
  id: tlv_stream
  endian: be
seq:
  - id: records
    type: record
    repeat: eos
types:
  record:
    seq:
      - id: tag
        type: u1
        enum: tag
      - id: len
        type: u2
      - id: body
        size: len
        type:
          switch-on: tag
          cases:
            'tag::position': position
            'tag::name': name
            'tag::gone': gone
            _: rest
  position:
    doc: Where it is.
    seq:
      - id: lat
        type: s4
      - id: lon
        type: s4
  name:
    seq:
      - id: text
        type: str
        size-eos: true
        encoding: ASCII
  rest:
    seq:
      - id: data
        size-eos: true
enums:
  tag:
    1: position
    2: name
    0xff:
      id: end
      doc: Nothing follows
