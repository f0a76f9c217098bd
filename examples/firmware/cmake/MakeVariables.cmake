# Reads `NAME = value`, `+=` and `?=` of a makefile, so that no fact about a port stands in two places.
#
# make_variables(file prefix): each becomes ${prefix}NAME, with $(OTHER) replaced. A value that the caller has given by
# -DNAME= goes before one of `?=`. Conditions and rules are not understood; what stands in them is for make alone.

function(make_variables file prefix)
  file(STRINGS "${file}" lines)
  foreach(line IN LISTS lines)
    if(line MATCHES "^([A-Z_]+) *([+?:]?)= *(.*)$")
      set(name "${prefix}${CMAKE_MATCH_1}")
      set(kind "${CMAKE_MATCH_2}")
      set(value "${CMAKE_MATCH_3}")
      if(kind STREQUAL "?" AND DEFINED "${CMAKE_MATCH_1}")
        set(value "${${CMAKE_MATCH_1}}")
      endif()
      while(value MATCHES "\\$\\(([A-Z_]+)\\)")
        string(REPLACE "$(${CMAKE_MATCH_1})" "${${prefix}${CMAKE_MATCH_1}}" value "${value}")
      endwhile()
      if(kind STREQUAL "+")
        set(value "${${name}} ${value}")
      endif()
      set(${name} "${value}")
      set(${name} "${value}" PARENT_SCOPE)
    endif()
  endforeach()
endfunction()
