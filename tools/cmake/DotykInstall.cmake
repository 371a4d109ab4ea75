# What `cmake --install` installs beside the program, and the package for Debian that `cpack -G DEB` makes of it.
include(GNUInstallDirs)
set(made ${PROJECT_BINARY_DIR}/install)
set(commands render summary convert)
install(TARGETS dotyk RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})

# The Python package with what Python's own tools know it by, and its commands: beside the program in the build, too.
install(DIRECTORY tools/python/dotyk DESTINATION ${DOTYK_MODULE_DIR} PATTERN __pycache__ EXCLUDE)
file(CONFIGURE OUTPUT ${made}/METADATA CONTENT "Metadata-Version: 2.1\nName: dotyk\nVersion: @PROJECT_VERSION@\n" @ONLY)
install(FILES ${made}/METADATA DESTINATION ${DOTYK_MODULE_DIR}/dotyk-${PROJECT_VERSION}.dist-info)
set(interpreter ${DOTYK_PYTHON})
if(NOT interpreter)
  set(interpreter "/usr/bin/env python3")
endif()
foreach(command ${commands})
  set(modules ${PROJECT_SOURCE_DIR}/tools/python)
  configure_file(tools/python/command.in ${PROJECT_BINARY_DIR}/dotyk-${command} @ONLY USE_SOURCE_PERMISSIONS)
  cmake_path(RELATIVE_PATH DOTYK_MODULE_DIR BASE_DIRECTORY ${CMAKE_INSTALL_BINDIR} OUTPUT_VARIABLE modules)
  configure_file(tools/python/command.in ${made}/dotyk-${command} @ONLY)
  install(PROGRAMS ${made}/dotyk-${command} DESTINATION ${CMAKE_INSTALL_BINDIR})
endforeach()

# The manual page, which the program prints, and completion; those of the commands are the same.
install(CODE "
execute_process(COMMAND \"$<TARGET_FILE:dotyk>\" --help=man OUTPUT_FILE \"${made}/dotyk.1\" COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND gzip -9nf \"${made}/dotyk.1\" COMMAND_ERROR_IS_FATAL ANY)")
install(FILES ${made}/dotyk.1.gz DESTINATION ${CMAKE_INSTALL_MANDIR}/man1)
set(completions ${CMAKE_INSTALL_DATADIR}/bash-completion/completions)
install(FILES tools/completion.bash DESTINATION ${completions} RENAME dotyk)
file(MAKE_DIRECTORY ${made}/links)
foreach(command ${commands})
  file(CREATE_LINK dotyk.1.gz ${made}/links/dotyk-${command}.1.gz SYMBOLIC)
  install(FILES ${made}/links/dotyk-${command}.1.gz DESTINATION ${CMAKE_INSTALL_MANDIR}/man1)
  file(CREATE_LINK dotyk ${made}/links/dotyk-${command} SYMBOLIC)
  install(FILES ${made}/links/dotyk-${command} DESTINATION ${completions})
endforeach()

# Pages and examples. The name of the changelog is Debian's.
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS CHANGELOG.md LICENSE)
configure_file(CHANGELOG.md ${made}/changelog COPYONLY)
execute_process(COMMAND gzip -9nfk ${made}/changelog COMMAND_ERROR_IS_FATAL ANY)
install(FILES README.md CITATION.cff ${made}/changelog.gz DESTINATION ${CMAKE_INSTALL_DOCDIR})
install(DIRECTORY docs/ DESTINATION ${CMAKE_INSTALL_DOCDIR}/docs FILES_MATCHING PATTERN "*.md" PATTERN "*.png")
# Permissions of their own: those of a source archive may let a group write.
install(DIRECTORY inputs/ DESTINATION ${CMAKE_INSTALL_DOCDIR}/examples FILES_MATCHING
        REGEX "/[^.][^/]*\\.(geo|nml|step|md|png)$" PATTERN .dotyk EXCLUDE)
install(DIRECTORY inputs/ DESTINATION ${CMAKE_INSTALL_DOCDIR}/examples
        FILE_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE
        FILES_MATCHING PATTERN check.py PATTERN .dotyk EXCLUDE PATTERN __pycache__ EXCLUDE)
# Links of the pages lead to inputs.
file(CREATE_LINK examples ${made}/links/inputs SYMBOLIC)
install(FILES ${made}/links/inputs DESTINATION ${CMAKE_INSTALL_DOCDIR})
file(READ LICENSE licence)
file(CONFIGURE OUTPUT ${made}/copyright @ONLY CONTENT "@licence@
The program is linked with the supernodal module of CHOLMOD, which is under the GNU General Public License, version 2 or
later. So is the program as a whole; on Debian that licence is in /usr/share/common-licenses/GPL-2.
")
install(FILES ${made}/copyright DESTINATION ${CMAKE_INSTALL_DOCDIR})
if(NOT PROJECT_IS_TOP_LEVEL)
  return()
endif()

# The package. Its maintainer is who makes it, by the variables of Debian's own tools.
set(CPACK_PACKAGE_CONTACT "The dotyk developers <dotyk@example.org>")
if(DEFINED ENV{DEBEMAIL} AND DEFINED ENV{DEBFULLNAME})
  set(CPACK_PACKAGE_CONTACT "$ENV{DEBFULLNAME} <$ENV{DEBEMAIL}>")
endif()
find_program(DOTYK_DPKG dpkg)
if(DOTYK_DPKG)
  # Its own changelog names the releases.
  file(STRINGS CHANGELOG.md releases REGEX "^## \\[")
  foreach(release ${releases})
    string(REGEX MATCH "\\[(.*)\\] - (.*)" _ ${release})
    execute_process(COMMAND date --utc --rfc-email --date ${CMAKE_MATCH_2} OUTPUT_VARIABLE date
                    COMMAND_ERROR_IS_FATAL ANY)
    string(APPEND changelog "dotyk (${CMAKE_MATCH_1}-1) unstable; urgency=medium\n\n  * Release ${CMAKE_MATCH_1}: see "
           "changelog.gz.\n\n -- ${CPACK_PACKAGE_CONTACT}  ${date}\n")
  endforeach()
  file(CONFIGURE OUTPUT ${made}/changelog.Debian CONTENT "@changelog@" @ONLY)
  execute_process(COMMAND gzip -9nfk ${made}/changelog.Debian COMMAND_ERROR_IS_FATAL ANY)
  install(FILES ${made}/changelog.Debian.gz DESTINATION ${CMAKE_INSTALL_DOCDIR})
endif()
set(CPACK_STRIP_FILES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ
    WORLD_EXECUTE)
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "frictionless contact of linear elastic bodies")
set(CPACK_DEBIAN_PACKAGE_DESCRIPTION "dotyk computes the frictionless unilateral contact of any number of
linear elastic bodies by finite elements, with bounds of the iteration
error and estimates of the discretization error. Bodies are meshes of
gmsh, CAD files, decks of Abaqus and CalculiX, or grids of VTK; results
are files for ParaView.
.
With the program come a Python package that writes scenes, runs them and
reads results, commands that draw and list results and convert decks, and
examples.")
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_DEPENDS "gmsh, python3, python3-h5py, python3-meshio, python3-numpy")
set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "python3-vtk9, xauth, xvfb")
set(scripts ${PROJECT_SOURCE_DIR}/tools/debian)
set(CPACK_DEBIAN_PACKAGE_CONTROL_EXTRA ${scripts}/postinst ${scripts}/prerm)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
include(CPack)
