#pragma once

#include <string>

namespace pmeta {

/// Of pMeta, as package.xml has it. Not inline: a library must not come to see that of the program.
constexpr char kVersion[] = "0.1.0";

/// Goes up with every change of a public header that a library of rows compiled before would not
/// fit: other members or virtual functions, another meaning of an argument.
constexpr int kInterface = 1;

/// Which catkin package something is of.
struct Package {
  std::string name;     ///< "" for pMeta itself, and for libraries that do not say
  std::string version;  ///< of its package.xml
};

/// How the code that registers a row was compiled. What differs from pMeta's own must not be loaded
/// with it: see misfit().
struct Build {
  const char* version;          ///< of pMeta's headers
  int interface;                ///< of pMeta's headers
  int alignment;                ///< of Eigen's arrays in bytes, which follows from -march
  bool checks_containers;       ///< -D_GLIBCXX_DEBUG: containers have another layout
  bool fast_math;               ///< -ffast-math: takes away NaN and, as it is loaded, small numbers
  const char* package;          ///< "" unless pmeta_add_library() says it
  const char* package_version;  ///< see package
};

#ifndef PMETA_PACKAGE
#define PMETA_PACKAGE ""
#define PMETA_PACKAGE_VERSION ""
#endif

/// Of the file that includes this: every file has its own, on purpose.
constexpr Build kThisBuild = {
    kVersion,
    kInterface,
#if defined(__AVX512F__)
    64,
#elif defined(__AVX__)
    32,
#else
    16,
#endif
#ifdef _GLIBCXX_DEBUG
    true,
#else
    false,
#endif
#ifdef __FAST_MATH__
    true,
#else
    false,
#endif
    PMETA_PACKAGE,
    PMETA_PACKAGE_VERSION,
};

/// Why rows of a library that was compiled so must not be taken, as a clause that begins with what
/// the library was; "" if they may.
std::string misfit(const Build& build);

}  // namespace pmeta
