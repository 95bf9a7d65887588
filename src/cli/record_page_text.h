// The fixed parts of the page of records, from src/cli/record_page/. The page names where the
// others and the data go: @STYLE@, @THREE@ ...
#pragma once

namespace brume::record_page_text {

extern const char* const kPage;
extern const char* const kStyle;
extern const char* const kDataView;
extern const char* const kShaders;
extern const char* const kRecords;
extern const char* const kScript;

}  // namespace brume::record_page_text
