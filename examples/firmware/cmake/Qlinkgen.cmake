# qlinkgen_generate: codecs that are made anew when their schema changes.
#
#   qlinkgen_generate(TARGET name SCHEMA file...
#     [TARGETS c...]            what to make, c unless said otherwise
#     [ROLE slave|master|both]  leave out the other side
#     [ONLY message...]         keep these commands or messages
#     [SET crc=NAME...]         another algorithm of the check value
#     [OUTPUT_DIRECTORY dir])   its own folder; <binary dir>/<name> unless given
#
# SCHEMA is a file, relative to the source folder, or the name of a schema that comes with qlinkgen. `name` becomes an
# interface library: target_link_libraries(firmware PRIVATE name) finds the headers, and makes them first. A build
# after a change of the schema or of these options makes them anew, any other build does not, and only what has really
# changed is compiled again.
#
# QLINKGEN_EXECUTABLE says what to run, where `qlinkgen` is not on the path. It may be a list: python3;-m;qlinkgen.

function(qlinkgen_generate)
  cmake_parse_arguments(PARSE_ARGV 0 arg "" "TARGET;ROLE;OUTPUT_DIRECTORY" "SCHEMA;TARGETS;ONLY;SET")
  _qlinkgen_check_arguments()
  _qlinkgen_find()
  if(NOT arg_TARGETS)
    set(arg_TARGETS c)
  endif()
  if(NOT arg_OUTPUT_DIRECTORY)
    set(arg_OUTPUT_DIRECTORY ${arg_TARGET})
  endif()
  get_filename_component(folder "${arg_OUTPUT_DIRECTORY}" ABSOLUTE BASE_DIR "${CMAKE_CURRENT_BINARY_DIR}")

  _qlinkgen_schemas(schemas files ${arg_SCHEMA})
  set(command ${QLINKGEN_EXECUTABLE} generate ${schemas} -o "${folder}")
  foreach(target IN LISTS arg_TARGETS)
    list(APPEND command --target ${target})
  endforeach()
  if(arg_ROLE)
    list(APPEND command --role ${arg_ROLE})
  endif()
  foreach(message IN LISTS arg_ONLY)
    list(APPEND command --only ${message})
  endforeach()
  foreach(setting IN LISTS arg_SET)
    list(APPEND command --set ${setting})
  endforeach()
  _qlinkgen_list_outputs(outputs ${command})

  # qlinkgen leaves files alone whose text stays the same, so it is the stamp that tells when it has run. That other
  # options are another command is seen by make and by Ninja.
  set(stamp "${CMAKE_CURRENT_BINARY_DIR}/${arg_TARGET}.stamp")
  add_custom_command(
    OUTPUT "${stamp}"
    BYPRODUCTS ${outputs}
    COMMAND ${command}
    COMMAND ${CMAKE_COMMAND} -E touch "${stamp}"
    DEPENDS ${files}
    WORKING_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}"
    COMMENT "qlinkgen: ${arg_TARGET}"
    VERBATIM)
  add_custom_target(${arg_TARGET}_generated DEPENDS "${stamp}")
  add_library(${arg_TARGET} INTERFACE)
  add_dependencies(${arg_TARGET} ${arg_TARGET}_generated)
  target_include_directories(${arg_TARGET} INTERFACE "${folder}/c")
endfunction()

macro(_qlinkgen_check_arguments)
  if(arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "qlinkgen_generate: no argument is called ${arg_UNPARSED_ARGUMENTS}; there are TARGET, SCHEMA, "
      "TARGETS, ROLE, ONLY, SET and OUTPUT_DIRECTORY")
  endif()
  if(NOT arg_TARGET OR NOT arg_SCHEMA)
    message(FATAL_ERROR "qlinkgen_generate: say TARGET, the name of the library to make, and SCHEMA")
  endif()
endmacro()

function(_qlinkgen_find)
  if(NOT QLINKGEN_EXECUTABLE) # find_program would make paths of the items of a list
    find_program(QLINKGEN_EXECUTABLE qlinkgen DOC "qlinkgen, or what to run in its place")
  endif()
  if(NOT QLINKGEN_EXECUTABLE)
    message(FATAL_ERROR "qlinkgen was not found, and is needed to generate headers. Install it (pip install qlinkgen), "
      "or say where it is: -DQLINKGEN_EXECUTABLE=/path/to/qlinkgen. Headers that are already made need none of this.")
  endif()
endfunction()

# Files with their whole path; the name of a schema that comes with qlinkgen as it is.
function(_qlinkgen_schemas schemas_out files_out)
  foreach(schema IN LISTS ARGN)
    get_filename_component(file "${schema}" ABSOLUTE)
    if(EXISTS "${file}")
      list(APPEND schemas "${file}")
      list(APPEND files "${file}")
    else()
      list(APPEND schemas "${schema}")
    endif()
  endforeach()
  # What a schema is called decides on the names of the outputs.
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${files})
  set(${schemas_out} ${schemas} PARENT_SCOPE)
  set(${files_out} ${files} PARENT_SCOPE)
endfunction()

function(_qlinkgen_list_outputs outputs_out)
  execute_process(
    COMMAND ${ARGN} --list-outputs
    WORKING_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}"
    RESULT_VARIABLE result
    OUTPUT_VARIABLE outputs
    ERROR_VARIABLE said)
  if(NOT result EQUAL 0)
    message(FATAL_ERROR "qlinkgen_generate: ${result}\n${said}")
  endif()
  string(REGEX REPLACE "\r?\n" ";" outputs "${outputs}")
  list(REMOVE_ITEM outputs "")
  set(${outputs_out} ${outputs} PARENT_SCOPE)
endfunction()
