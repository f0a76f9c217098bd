# qlinkgen_generate: generates codecs again when their schema changes.
#
#   qlinkgen_generate(TARGET name SCHEMA file...
#     [TARGETS c...]            targets of qlinkgen, c by default
#     [ROLE slave|master|both]  leave out the other side
#     [ONLY message...]         keep these commands or messages
#     [SET crc=NAME...]         another algorithm of the check value
#     [OUTPUT_DIRECTORY dir])   its own folder; default: <binary dir>/<name>
#
# SCHEMA is a file, relative to the source folder, or the name of a schema shipped with qlinkgen. `name` becomes an
# interface library: target_link_libraries(firmware PRIVATE name) adds the headers, and generates them first. Only a
# build after a change of the schema or of these options generates them again, and only sources with changed headers
# are compiled again.
#
# QLINKGEN_EXECUTABLE is the command to run if `qlinkgen` is not on the path. It may be a list: python3;-m;qlinkgen.

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

  # qlinkgen does not touch files with unchanged text, so the stamp records its last run. make and Ninja see changed
  # options as a changed command.
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
    message(FATAL_ERROR "qlinkgen_generate: unknown argument ${arg_UNPARSED_ARGUMENTS}; arguments: TARGET, SCHEMA, "
      "TARGETS, ROLE, ONLY, SET and OUTPUT_DIRECTORY")
  endif()
  if(NOT arg_TARGET OR NOT arg_SCHEMA)
    message(FATAL_ERROR "qlinkgen_generate: give TARGET, the name of the library to make, and SCHEMA")
  endif()
endmacro()

function(_qlinkgen_find)
  if(NOT QLINKGEN_EXECUTABLE) # find_program would make paths of the items of a list
    find_program(QLINKGEN_EXECUTABLE qlinkgen DOC "qlinkgen, or the command to run instead")
  endif()
  if(NOT QLINKGEN_EXECUTABLE)
    message(FATAL_ERROR "qlinkgen was not found, and is needed to generate headers. Install it (pip install qlinkgen), "
      "or set -DQLINKGEN_EXECUTABLE=/path/to/qlinkgen. Existing headers do not need it.")
  endif()
endfunction()

# Files as absolute paths; names of schemas shipped with qlinkgen unchanged.
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
  # The names of the outputs depend on the name of the schema.
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
