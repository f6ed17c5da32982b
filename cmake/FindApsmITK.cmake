# The few ITK libraries that image files need, as the target Apsm::ITK, and those for DICOM, as
# Apsm::ITKGDCM, if they are there.  find_package(ITK) would link GDCM into everything, which
# makes up most of the start-up time of a program.
file(GLOB itk_headers /usr/include/ITK-5.* /usr/local/include/ITK-5.*)
list(SORT itk_headers COMPARE NATURAL ORDER DESCENDING)
find_path(ApsmITK_INCLUDE_DIR itkNrrdImageIO.h HINTS ${itk_headers})
string(REGEX MATCH "[0-9]+\\.[0-9]+$" ApsmITK_VERSION "${ApsmITK_INCLUDE_DIR}")

# Debian has them as libITKCommon-5.2.so, a build from source as libITKCommon-5.2.so as well.
function(apsm_itk_target target)
  set(libraries)
  foreach(name ${ARGN})
    find_library(ApsmITK_${name}_LIBRARY NAMES ${name}-${ApsmITK_VERSION}
                 lib${name}-${ApsmITK_VERSION}.so.1)
    if(NOT ApsmITK_${name}_LIBRARY)
      return()
    endif()
    list(APPEND libraries ${ApsmITK_${name}_LIBRARY})
  endforeach()
  add_library(${target} INTERFACE IMPORTED GLOBAL)
  set_target_properties(${target} PROPERTIES
    INTERFACE_INCLUDE_DIRECTORIES ${ApsmITK_INCLUDE_DIR}
    INTERFACE_LINK_LIBRARIES "${libraries}")
endfunction()

if(ApsmITK_INCLUDE_DIR AND NOT TARGET Apsm::ITK)
  apsm_itk_target(Apsm::ITK ITKIONRRD ITKIONIFTI ITKIOMeta ITKIOImageBase ITKCommon itkvnl itksys)
  apsm_itk_target(Apsm::ITKGDCM ITKIOGDCM ITKIOImageBase ITKCommon itkvnl_algo itkvnl itksys)
endif()
if(TARGET Apsm::ITK)
  set(ApsmITK_TARGET Apsm::ITK)
endif()
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(ApsmITK REQUIRED_VARS ApsmITK_INCLUDE_DIR ApsmITK_TARGET
  VERSION_VAR ApsmITK_VERSION REASON_FAILURE_MESSAGE "run scripts/setup, or install libinsighttoolkit5-dev")
