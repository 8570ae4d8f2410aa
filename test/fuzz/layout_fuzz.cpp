#include "fuzz_support.h"
#include "pmeta_core/base/error.h"
#include "pmeta_core/base/model.h"
#include "targets.h"

namespace pmeta::fuzz {

void fuzzLayout(const std::uint8_t* data, std::size_t size) {
  try {
    const std::string text = textOf(data, size);
    const ModelLayout layout = ModelLayout::parse(text);
    require(layout.text() == text, "a layout reads as another text");
    const ModelLayout rebuilt(layout.precision(), layout.blocks());
    require(rebuilt == layout && rebuilt.hash() == layout.hash() && rebuilt.size() == layout.size(),
            "a layout's blocks do not give the layout");
    std::size_t scalars = 0;
    for (const Block& block : layout.blocks()) scalars += block.size();
    require(scalars == layout.size(), "a layout's size is not that of its blocks");
  } catch (const Error&) {
  }
}

}  // namespace pmeta::fuzz
