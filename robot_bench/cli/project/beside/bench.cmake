# Targets `bench` (drives the program on the test bench) and `bench-tests`. In CMakeLists.txt, behind what makes the program:
#     include(bench/bench.cmake)
#     bench_program(NAME)
function(bench_program program)
    set(folder ${CMAKE_CURRENT_FUNCTION_LIST_DIR})
    add_custom_target(bench
        COMMAND p2os run ${folder}/bench.toml --firmware $<TARGET_FILE:${program}>
        DEPENDS ${program} WORKING_DIRECTORY ${CMAKE_SOURCE_DIR} USES_TERMINAL)
    add_custom_target(bench-tests
        COMMAND pytest ${folder} --firmware $<TARGET_FILE:${program}>
        DEPENDS ${program} WORKING_DIRECTORY ${CMAKE_SOURCE_DIR} USES_TERMINAL)
endfunction()
