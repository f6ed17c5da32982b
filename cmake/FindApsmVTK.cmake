# VTK's libraries as the target Apsm::VTK.  Debian's libvtk9-dev pulls in 460 packages, while its
# headers need none of them: so scripts/setup unpacks the headers alone into .deps/, and this
# module brings them together with the run-time libraries (libvtkCommonCore-9.1.so.1).
file(GLOB vtk_headers ${CMAKE_SOURCE_DIR}/.deps/usr/include/vtk-9.* /usr/include/vtk-9.*
     /usr/local/include/vtk-9.*)
list(SORT vtk_headers COMPARE NATURAL ORDER DESCENDING)

# The newest version of which both headers and libraries are there.
set(vtk_names CommonCore CommonMisc CommonMath CommonDataModel CommonExecutionModel FiltersCore IOXML
    RenderingCore RenderingFreeType sys)
foreach(folder ${vtk_headers})
  string(REGEX MATCH "[0-9]+\\.[0-9]+$" ApsmVTK_VERSION "${folder}")
  set(ApsmVTK_LIBRARIES)
  foreach(name ${vtk_names})
    find_library(ApsmVTK_${ApsmVTK_VERSION}_${name} NAMES libvtk${name}-${ApsmVTK_VERSION}.so.1
                 vtk${name}-${ApsmVTK_VERSION} libvtk${name}-${ApsmVTK_VERSION}.so.9)
    if(ApsmVTK_${ApsmVTK_VERSION}_${name})
      list(APPEND ApsmVTK_LIBRARIES ${ApsmVTK_${ApsmVTK_VERSION}_${name}})
    endif()
  endforeach()
  list(LENGTH ApsmVTK_LIBRARIES found)
  list(LENGTH vtk_names wanted)
  if(found EQUAL wanted AND EXISTS ${folder}/vtkPolyData.h)
    set(ApsmVTK_INCLUDE_DIR ${folder})
    break()
  endif()
endforeach()

if(ApsmVTK_INCLUDE_DIR AND NOT TARGET Apsm::VTK)
  add_library(Apsm::VTK INTERFACE IMPORTED GLOBAL)
  set_target_properties(Apsm::VTK PROPERTIES
    INTERFACE_INCLUDE_DIRECTORIES ${ApsmVTK_INCLUDE_DIR}
    INTERFACE_LINK_LIBRARIES "${ApsmVTK_LIBRARIES}")
endif()
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(ApsmVTK REQUIRED_VARS ApsmVTK_INCLUDE_DIR
  VERSION_VAR ApsmVTK_VERSION REASON_FAILURE_MESSAGE "run scripts/setup, or install libvtk9-dev")
