set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_C_COMPILER arm-none-eabi-gcc)
# A program of the test would need the linker script of a board.
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
