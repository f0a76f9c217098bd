meta:
  id: gnss
  endian: le
seq:
  - id: messages
    type: message
    repeat: eos
types:
  message:
    seq:
      - id: sync
        contents: [0xb5, 0x62]
      - id: kind
        type: u2be
        enum: kind
      - id: length
        type: u2
      - id: payload
        size: length
        type:
          switch-on: kind
          cases:
            'kind::nav_sat': nav_sat
            'kind::nav_pos': nav_pos
      - id: checksum
        type: u2
  nav_sat:
    doc: Satellites in view.
    seq:
      - id: itow
        type: u4
        doc: Time of the week in ms
      - id: version
        type: u1
        valid: 1
      - id: num_svs
        type: u1
      - id: reserved
        type: u2
      - id: svs
        type: sat
        repeat: expr
        repeat-expr: num_svs
    types:
      sat:
        seq:
          - id: gnss_id
            type: u1
            enum: gnss
          - id: sv_id
            type: u1
          - id: cno
            type: u1
          - id: elevation
            type: s1
          - id: azimuth
            type: s2
          - id: residual
            type: s2
          - id: flags
            type: u4
  nav_pos:
    seq:
      - id: itow
        type: u4
      - id: lon
        type: s4
      - id: lat
        type: s4
enums:
  kind:
    0x0135: nav_sat
    0x0102: nav_pos
  gnss:
    0: gps
    2: galileo
    6: glonass
