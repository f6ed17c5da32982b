# What is installed, and the Debian packages: apsm (program), libapsm0 (library), libapsm-dev.
option(APSM_PACKAGE "install as Debian wants it: for `make package`" OFF)
install(TARGETS apsm
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT library NAMELINK_COMPONENT development)
if(TARGET apsm_cli)
  install(TARGETS apsm_cli RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT program)
  # A manual page for every verb, of what the program says of it.
  file(MAKE_DIRECTORY ${CMAKE_BINARY_DIR}/man)
  if(APSM_PACKAGE)
    set(pack COMMAND sh -c "gzip -9nf man/*.1")
  endif()
  add_custom_command(OUTPUT ${CMAKE_BINARY_DIR}/man.made
    COMMAND ${CMAKE_SOURCE_DIR}/scripts/make-man $<TARGET_FILE:apsm_cli> ${CMAKE_BINARY_DIR}/man
    COMMAND ${CMAKE_COMMAND} -E copy ${CMAKE_SOURCE_DIR}/docs/man/apsm.1 ${CMAKE_BINARY_DIR}/man/apsm.1
    ${pack}
    COMMAND ${CMAKE_COMMAND} -E touch ${CMAKE_BINARY_DIR}/man.made
    DEPENDS apsm_cli ${CMAKE_SOURCE_DIR}/scripts/make-man ${CMAKE_SOURCE_DIR}/docs/man/apsm.1)
  add_custom_target(man ALL DEPENDS ${CMAKE_BINARY_DIR}/man.made)
  install(DIRECTORY ${CMAKE_BINARY_DIR}/man/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1
    COMPONENT program FILES_MATCHING PATTERN *.1 PATTERN *.1.gz)
endif()
install(DIRECTORY include/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT development
  FILES_MATCHING PATTERN *.h)
file(GLOB documents ${CMAKE_SOURCE_DIR}/docs/*.md)
install(FILES README.md CHANGELOG.md CITATION.cff DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT program)
install(FILES ${documents} DESTINATION ${CMAKE_INSTALL_DOCDIR}/docs COMPONENT program)
install(DIRECTORY docs/figures DESTINATION ${CMAKE_INSTALL_DOCDIR}/docs COMPONENT program)

# apsm.pc finds its prefix from where it lies, so that an installation can be moved.
set(pc_folder ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
file(RELATIVE_PATH APSM_PC_PREFIX /${pc_folder} /)
configure_file(${CMAKE_SOURCE_DIR}/cmake/apsm.pc.in ${CMAKE_BINARY_DIR}/apsm.pc @ONLY)
install(FILES ${CMAKE_BINARY_DIR}/apsm.pc DESTINATION ${pc_folder} COMPONENT development)

# ---- Debian, by `make package` ----

if(APSM_PACKAGE)
  # Manual pages packed; copyright and changes where policy has them.
  foreach(package apsm libapsm0 libapsm-dev)
    set(doc ${CMAKE_INSTALL_DATAROOTDIR}/doc/${package})
    string(REPLACE libapsm-dev development component ${package})
    string(REPLACE libapsm0 library component ${component})
    string(REPLACE apsm program component ${component})
    install(FILES ${CMAKE_SOURCE_DIR}/cmake/copyright DESTINATION ${doc} COMPONENT ${component})
    install(FILES ${CMAKE_BINARY_DIR}/changelog.gz DESTINATION ${doc} COMPONENT ${component})
  endforeach()
  add_custom_command(OUTPUT ${CMAKE_BINARY_DIR}/changelog.gz
    COMMAND ${CMAKE_SOURCE_DIR}/scripts/make-changelog ${PROJECT_VERSION} ${CMAKE_BINARY_DIR}/changelog.gz
    DEPENDS ${CMAKE_SOURCE_DIR}/CHANGELOG.md ${CMAKE_SOURCE_DIR}/scripts/make-changelog)
  add_custom_target(changelog ALL DEPENDS ${CMAKE_BINARY_DIR}/changelog.gz)
endif()

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME apsm)
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGE_CONTACT "The apsm developers <apsm@example.org>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "statistical shape models from meshes and segmentations")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_ALL program library development)
# Dependencies are those of the libraries that are linked.
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${CMAKE_BINARY_DIR})
file(WRITE ${CMAKE_BINARY_DIR}/debian/triggers "activate-noawait ldconfig\n")
file(WRITE ${CMAKE_BINARY_DIR}/debian/shlibs "libapsm 0 libapsm0 (>= ${PROJECT_VERSION})\n")
set(CPACK_DEBIAN_LIBRARY_PACKAGE_CONTROL_EXTRA ${CMAKE_BINARY_DIR}/debian/triggers ${CMAKE_BINARY_DIR}/debian/shlibs)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME apsm)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_NAME libapsm0)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libapsm-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SHLIBDEPS OFF)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "libapsm0 (= ${PROJECT_VERSION})")
set(what "Particles that correspond across anatomical shapes and follow each\nshape's detail, a model of how the shapes vary, a verdict on the\ncorrespondence, fits of new shapes, statistics, a report for the browser.")
set(CPACK_DEBIAN_PROGRAM_DESCRIPTION "${what}")
set(CPACK_DEBIAN_LIBRARY_DESCRIPTION "The shared library.\n\n${what}")
set(CPACK_DEBIAN_DEVELOPMENT_DESCRIPTION "Headers of the library, and its file for pkg-config.\n\n${what}")
include(CPack)
