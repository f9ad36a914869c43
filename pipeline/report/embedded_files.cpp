#include "pipeline/report/embedded_files.h"

#include <cstddef>

// The assembler copies each file into read-only data. CMake gives the paths, and compiles this source again
// when one of the files changes.
#define Q3D_EMBED(name, file)                                       \
  __asm__(                                                          \
      ".pushsection .rodata\n"                                      \
      ".global q3d_embedded_" #name "\n.global q3d_embedded_" #name \
      "_end\n"                                                      \
      "q3d_embedded_" #name ":\n.incbin \"" file                    \
      "\"\n"                                                        \
      "q3d_embedded_" #name "_end:\n.byte 0\n.popsection\n");       \
  extern "C" const char q3d_embedded_##name[];                      \
  extern "C" const char q3d_embedded_##name##_end[];

Q3D_EMBED(template, Q3D_PAGE_FOLDER "/report.html")
Q3D_EMBED(style, Q3D_PAGE_FOLDER "/report.css")
Q3D_EMBED(charts, Q3D_PAGE_FOLDER "/report.js")
Q3D_EMBED(explorer, Q3D_PAGE_FOLDER "/explorer.js")
Q3D_EMBED(further, Q3D_PAGE_FOLDER "/charts.js")
Q3D_EMBED(plotly, Q3D_PLOTLY_FILE)

namespace q3d::pipeline::report {
namespace {

std::string_view between(const char* begin, const char* end) {
  return {begin, static_cast<std::size_t>(end - begin)};
}

}  // namespace

std::string_view page_template() {
  return between(q3d_embedded_template, q3d_embedded_template_end);
}

std::string_view page_style() {
  return between(q3d_embedded_style, q3d_embedded_style_end);
}

std::string_view page_charts() {
  return between(q3d_embedded_charts, q3d_embedded_charts_end);
}

std::string_view page_explorer() {
  return between(q3d_embedded_explorer, q3d_embedded_explorer_end);
}

std::string_view page_further_charts() {
  return between(q3d_embedded_further, q3d_embedded_further_end);
}

std::string_view plotly_script() {
  return between(q3d_embedded_plotly, q3d_embedded_plotly_end);
}

}  // namespace q3d::pipeline::report
