# For packages with environments, learners, algorithms, rules or scenes of their own:
#
#   pmeta_add_library(my_robots src/my_family.cpp ...)
#
# A shared library that records the package, whose name and version a run's manifest then has. To be
# called after catkin_package(), or in plain CMake after find_package(pmeta_core) and project().
function(pmeta_add_library target)
  add_library(${target} SHARED ${ARGN})
  target_include_directories(${target} PRIVATE ${catkin_INCLUDE_DIRS} ${pmeta_core_INCLUDE_DIRS})
  target_link_libraries(${target} ${catkin_LIBRARIES} ${pmeta_core_LIBRARIES})
  target_compile_features(${target} PRIVATE cxx_std_17)
  # as pMeta is compiled: the same result on every processor
  target_compile_options(${target} PRIVATE -ffp-contract=off)
  target_compile_definitions(${target} PRIVATE
    PMETA_PACKAGE="${PROJECT_NAME}" PMETA_PACKAGE_VERSION="${${PROJECT_NAME}_VERSION}")
endfunction()
